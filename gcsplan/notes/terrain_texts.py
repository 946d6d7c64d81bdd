"""Sentences on terrain: its files, what is unknown or differs in them, and what its heights mean."""

TEXTS = {
    "several_bands": "{raster} has {bands} bands; the first is taken as the heights",
    "crs_replaced": "`crs: {crs}` is used instead of the file's own coordinate system",
    "heights_in_unit_of_key": "heights are {height_unit} by {key:height_unit}, in place of {stated}",
    "heights_in_unit": "heights are {height_unit}, {by}",
    "heights_taken_as_amsl": "heights in {datum} are taken as AMSL; it may differ from EGM96 by a metre or two",
    "datum_shift_inaccurate": (
        "the accuracy of the datum shift between WGS84 and {crs} is {accuracy_m:distance}; {key:track_error_m} should "
        "hold it"
    ),
    "datum_shift_of_unknown_accuracy": (
        "the accuracy of the datum shift between WGS84 and {crs} is unknown; {key:track_error_m} should hold it"
    ),
    "tiles_differ": (
        "tiles differ where they overlap ({nodes} nodes, {worst_m:height} at most); each limit counts the unfavourable "
        "height"
    ),
    "nodes_unknown": "{unknown} of {nodes} DEM nodes around the mission are unknown (void or no tile)",
    "posts_unknown": "{unknown} of {nodes} DEM nodes around the mission are unknown (no block)",
    "canopy_unknown": (
        "the canopy is unknown at {unknown} of {nodes} DEM nodes, which cannot be flown over; canopy_nodata_m gives "
        "them a height"
    ),
    "zeros_are_voids": (
        "{nodes} DEM {nodes:node|nodes} of exactly 0 m ({largest} {largest:node|nodes} around {lat_deg:.5f}, "
        "{lon_deg:.5f}) {nodes:stands|stand} beside ground of {beside_m:height.0} and more without a shore: an "
        "undeclared void, whose ground is unknown; if it is ground or sea, say `nodata: none`, and if every 0 is a "
        "void `nodata: 0`"
    ),
    "zeros_are_voids_in_several_places": (
        "{nodes} DEM {nodes:node|nodes} of exactly 0 m ({largest} {largest:node|nodes} around {lat_deg:.5f}, "
        "{lon_deg:.5f} and {more} more) {nodes:stands|stand} beside ground of {beside_m:height.0} and more without a "
        "shore: an undeclared void, whose ground is unknown; if it is ground or sea, say `nodata: none`, and if every "
        "0 is a void `nodata: 0`"
    ),
    "zeros_without_neighbours": (
        "{nodes} DEM {nodes:node|nodes} of exactly 0 m, around which nothing else is known, count as sea or ground; if "
        "they are voids, say `nodata: 0`"
    ),
    "terrain_in_whole_metres": (
        "terrain of ArduPilot's .DAT files is in whole metres and may have been cut down to them: up to 1 m lower than "
        "its source; {key:altitude_error_m} should hold it"
    ),
    "terrain_blocks_unused": "{count} {count:block|blocks} not used: {why}; the ground there is unknown",
    "checksum_wrong": "its checksum is wrong",
    "format_of_other_version": "its format is version {version}, wanted {wanted}",
    "spacing_differs": "its spacing is {spacing_m} m, that of most is {most_m} m",
    "spacing_is_zero": "its spacing is 0",
    "block_lies_elsewhere": "it lies elsewhere than its corner says (older tools placed blocks otherwise)",
    "terrain_is_a_surface": (
        "{source} is a surface model: where trees or buildings stand at the start, its ground is too high, and "
        "altitudes relative to home are flown lower by that; start in the open, or let {key:altitude_error_m} hold it"
    ),
    "tiles_are_sea": "sea, 0 m: {tiles}, which neither {source} nor GLO-90 has a tile of",
    "tiles_are_sea_by_mission": "sea, 0 m, because the mission says so: {tiles}; GLO-90 shows land there",
    "tiles_not_published": (
        "{source} does not publish {tiles}, and GLO-90 shows land there: the ground is unknown and cannot be flown over"
    ),
}
