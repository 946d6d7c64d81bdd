"""Sentences on no-fly zones: how their files were read, what of them is not used, and what each zone has of its own."""

TEXTS = {
    # -- of the zones that the note names behind its sentence --
    "zone_limits_read": "floors and ceilings are read from other attributes than gcsplan's own",
    "zone_attributes_unread": "these attributes are not read, and limit nothing",
    "zone_times_unread": "these attributes of times are not read: the zones count as always",
    "zone_times_not_understood": "the times of these zones are not understood: they count as always",
    "zone_activation_not_understood": ("the time of activation is not understood: these zones count as always"),
    "zone_hours_of_operation_unread": "openAIP's hours of operation are not read: these zones count as always",
    "zone_floor_at_flight_level": (
        "flight levels are pressure altitudes, which move with the weather: these zones count from the ground up, and "
        "no mission passes under them"
    ),
    "zone_ceiling_at_flight_level": (
        "flight levels are pressure altitudes, which move with the weather: these zones have no upper end, and no "
        "mission passes over them"
    ),
    "zone_flight_levels_uncertain": (
        "flight levels lie as far from their heights above sea level as the mission says ({key:flight_level_error_m})"
    ),
    "zone_limits_above_ellipsoid": (
        "limits above the ellipsoid are no heights above sea level: these zones are larger by the most that the two "
        "differ anywhere"
    ),
    "zone_limits_in_feet_above_sea": (
        "limits without a unit or a reference are read as OpenAir's programs do, in feet above sea level"
    ),
    "zone_limits_move": ("the limits of these zones move: at that end they count from the ground up, or without end"),
    "zone_limits_not_understood": (
        "the limits of these zones are not understood: they count from the ground up without end"
    ),
    "zone_corner_altitudes_unread": "the altitudes of corners are not read as limits",
    "zone_drawn_altitudes_unread": "the drawn altitudes are not read as limits",
    "zone_ceiling_as_drawn": (
        "the ceiling is the height to which the zone is drawn; one over the ground follows it point by point"
    ),
    "zone_radius_of_polygon_unread": (
        "the radius of a polygon is not read, so that nothing beyond its outline is kept clear"
    ),
    "zone_buffer_of_polygon_unread": (
        "the buffer of a polygon is not read, so that nothing beyond its outline is kept clear"
    ),
    "zone_across_the_antimeridian": (
        "outlines with edges such as from 179.9 to -179.9 are read as across the 180° meridian"
    ),
    "zone_outline_crosses": "the outlines of these zones cross or touch themselves: all that they enclose is no-fly",
    "zone_outline_widened": (
        "an outline of more than {most_corners} corners is drawn wider with fewer, by at most {wider_m:distance}, and "
        "so are these zones"
    ),
    "zone_needs_authorisation": "these zones may be entered with an authorisation, and are no-fly without one",
    "zone_conditions_not_judged": (
        "these zones may be entered under conditions, which are not judged: they are no-fly"
    ),
    "zone_centre_carried_over": (
        "arcs without a centre (V X=…) in their own zone are drawn around that of the zone before"
    ),
    "zone_text_behind_place_unread": "text behind a place is not read",
    "zone_text_behind_height_unread": "text behind the height is not read",
    # -- what a zone has of its own, in brackets behind its name --
    "zone_and_detail": "{zone} ({detail})",
    "further_zones": "and {count} more",
    "level_of_attribute": "{given}: {bound} at {level_m:height} {datum}",
    "drawn_height": "{top_m:height} {datum}",
    "drawn_height_of_highest_corner": "{top_m:height} {datum}, the highest corner's",
    "drawn_up_to": "up to {top_m:height}",
    "drawn_up_to_in_mode": "up to {top_m:height} {mode}",
    "drawn_with_fewer_corners": "{corners} for {given}",
    "size_of_zone": "{size_m:distance}",
    "line_of_file": "line {line}: {text}",
    # -- what is not used --
    "zones_of_other_kinds": "not used, because their kinds are not among those of the mission ({kinds})",
    "zones_restrict_nothing": "not used, because they restrict nothing",
    "zones_authorised": "not used, because the mission says that it is authorised to enter them",
    "zones_out_of_hours": "not used, because they do not apply in the hours of the mission ({hours})",
    "zones_unused_far_away": "not used: {count} further {count:zone|zones} far from the mission",
    "zones_left_out": "left out: {count} {count:zone|zones} of files, too far away to matter",
    "zone_not_understood": "{where}: {why}",
    # -- how a file was read --
    "holes_are_no_fly": "{count} {count:hole|holes} in polygons counted as no-fly",
    "terrain_records_unused": "not used, because they draw terrain: {records}",
    "tracks_unused": "not used: {count} {count:track or way point|tracks and way points} of a mission",
    "pictures_unused": "not used: {kinds}",
    "gdal_warns": "GDAL warns: {warning}",
    "converted_to_wgs84": "converted from {crs} to WGS 84 (good to {accuracy_m:distance})",
    "converted_to_wgs84_somehow": "converted from {crs} to WGS 84 (accuracy unknown)",
}
