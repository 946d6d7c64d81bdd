"""Sentences on files that were read: missions, zones, terrain, logs."""

INPUT_TEXTS = {
    # -- how the keys of a mission file, and the options that stand for them, were read --
    "change_of_key": "{option}: {key_path} is {now} in place of {was}",
    "change_adds_key": "{option}: {key_path} is {now}, where nothing is given",
    "change_adds_zone": "{option}: no_fly has {now}, too",
    "change_of_zones": "{option}: {now} in place of {count} {count:entry|entries} of no_fly",
    "value_converted": "{given} {symbol}, read as {own_key}: {value}",
    "charge_converted": "{given} {symbol} at {volts:g} V, read as {own_key}: {value}",
    "key_read_as_another": "read as {own_key}",
    "and_as_many_more": "{note} (and {count} more)",
    "more_values_converted": "{count} more values are converted from other units",
    "place_is_a_square": "'{given}' is a square of {size} in MGRS; its south-west corner is taken",
    "zone_letter_is_the_hemisphere": (
        "the S of zone {zone}S is the southern hemisphere: the northing is not in band S"
    ),
    "defaults_taken": "not given, so by default: {defaults}",
    "default_of_limit": "{limit:key} {value:g}",
    "default_of_climb": "{key:max_climb_deg} {climb_deg:g}",
    "default_of_speed": "speed always {speed_m_s:speed}",
    "limit_assumed": "{limit:key} is not given, {value:g} is taken",
    "plane_climb_assumed": "{key:max_climb_deg} is not given, {climb_deg:g} is taken for a plane",
    "one_speed": "speed_m_s is one number, read as [{slow_m_s:g}, {fast_m_s:g}]: always this speed",
    "lean_bounds_speed": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: a lean of {lean_deg:g}°"
        "{by_default:, ArduCopter's default,| (lean_angle_deg)} allows about that"
    ),
    "lean_bounds_speed_curably": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: a lean of {lean_deg:g}°"
        "{by_default:, ArduCopter's default,| (lean_angle_deg)} allows about that; for {wanted_m_s:speed} write "
        "{key:lean_angle_deg}: {needs_deg}, and set {setting}"
    ),
    "velocity_bounds_speed": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: MPC_XY_VEL_MAX {most_m_s:g} m/s"
        "{by_default:, PX4's default,| (mpc_xy_vel_max_m_s)} allows no more; for {wanted_m_s:speed} write "
        "mpc_xy_vel_max_m_s: {wanted_m_s:g}, and set MPC_XY_VEL_MAX {wanted_m_s:g}"
    ),
    "motion_unbounded": (
        "in local metres {keys} bound nothing unless they are given: flight times are the ideal ones of the papers"
    ),
    "terrain_error_without_frame": "{key:terrain_error_m} counts with altitude_frame: terrain only",
    "cruise_is_base_power": (
        "{given_key} {given:g} is read as base_w {base_w:.4g}, the power for as long as it flies, and "
        "horizontal_j_per_m 0"
    ),
    "cruise_is_base_power_climb_of_paper": (
        "{given_key} {given:g} is read as base_w {base_w:.4g}, the power for as long as it flies, and "
        "horizontal_j_per_m 0; a metre up or down takes {vertical_j_per_m:g} J, as in the paper, unless "
        "vertical_j_per_m is given"
    ),
    "energy_in_part_of_paper": (
        "{costs} {costs:is the paper's|are the paper's}, not this aircraft's, for `energy:` says nothing of "
        "{costs:it|them}"
    ),
    "key_and_value": "{name} {value:g}",
    "hover_below_base_power": (
        "hover_w {hover_w:g} is less than base_w {base_w:.4g}, the power of flying at any speed: a hold counts "
        "{base_w:.4g} W"
    ),
    "start_at_home": "the vehicle reports no position: its home is the start",
    "start_at_vehicle": "the start is where the vehicle is, {away_m:distance.0} from its home",
    "position_of_armed_vehicle": "the vehicle is armed: its position may not be on the ground",
    "parameters_not_read": "no parameters could be read: the return altitude is left open",
    "ground_is_flat": "the ground is flat at {flat_m:height} above sea level in this mission: no hill is seen",
    # -- the declared wind --
    "still_air": "still air: times, energies and paths count no wind",
    "wind_declared": "declared wind: {speeds} from {directions}; {blows}{gusts}",
    "wind_speed": "{most_m_s:speed.1}",
    "wind_speeds": "{least_m_s:speed.1 bare} to {most_m_s:speed.1}",
    "wind_from": "{from_deg:.0f}°",
    "wind_from_range": "{from_deg:.0f}° to {to_deg:.0f}°",
    "wind_from_any": "any direction",
    "wind_is_one": "one wind during the whole flight",
    "wind_varies": "another one at each place and time",
    "wind_gusts": "; gusts up to {gust_m_s:speed.1}",
    "wind_of_forecast": (
        "wind by the forecast {file} for {lat_deg:.4f}, {lon_deg:.4f}, at most {away_m:reach} from the mission's "
        "places, {hours}"
    ),
    # -- a file that is checked: its home, its fence, and the hours for which it is judged --
    "home_row_blank": "the file's home row is blank: the vehicle's start in the mission file was taken for home",
    "home_row_elsewhere": (
        "the file's home row lies elsewhere: the vehicle's start in the mission file was taken for home"
    ),
    "home_given": "{key:start} was taken for the file's home",
    "fence_unread": "the file's fence: {why}",
    "brings_fence": (
        "the file brings a fence of its own: {out} {out:area|areas} to stay out of, {inside} to stay inside of"
    ),
    "brings_rally": (
        "the file brings {count} {count:rally point|rally points} of its own, and with them on board a return leads to "
        "the nearest of home and rally points"
    ),
    "rally_point_off_terrain": (
        "rally point {number} lies at {lat:.6f}, {lon:.6f}, where the ground is not known: nothing about it is judged"
    ),
    "terrain_of_layers": (
        "the terrain has layers, of which the finer counts where it is known: {layers}; at {nodes} "
        "{nodes:node|nodes} beside seams and in coarser cells the ground lies between two heights, up to "
        "{worst_m:height.2 up} apart"
    ),
    "unknown_is_sea": (
        "{nodes} {nodes:node|nodes} without ground in the tiles {nodes:is|are} at the level of the sea, as `sea: true` "
        "states"
    ),
    "no_zone_for_fence": "no zone can be sent as a fence: the fence on board is left as it is",
    "no_rally_points_to_send": "there are no rally points to send: the list on board is left as it is",
    "flies_beyond_hours": (
        "the hours of zones: zones that do not apply from {hours} were left out, and the flight from then on: it lasts "
        "to {until}; write at: [from, to] with all of the flight in it"
    ),
    "flies_beyond_forecast": (
        "the hours of the forecast: the wind is known until {until}, and the flight is not surely over by then; write "
        "at: [from, to] with all of the flight in it"
    ),
    "hours_without_landing": (
        "the hours of zones: zones that do not apply from {hours} were left out, and the flight from then on: it ends "
        "in the air, and when it lands is not known: end it with a landing (a multicopter also with an RTL), or leave "
        "`at` out, so that all zones count"
    ),
    # -- mission files of ground stations (.waypoints, .plan), and on the fence that is made of zones --
    "home_row_without_place": "the home row holds no place (0, 0): the mission's own home was taken",
    "home_row_at_zero": "the home row holds the place 0, 0, which is what a vehicle without a position writes",
    "home_row_missing": "the file has no home row: the mission's own home was taken",
    "six_decimals": (
        "the coordinates have six decimals (0.11 m), as MAVProxy and pymavlink save them: coarser than the wire, so "
        "this file cannot verify the list on board exactly"
    ),
    "plan_home_missing": "the file has no home: the mission's own home was taken",
    "plan_home_without_place": "the file's home holds no place (0, 0): the mission's own home was taken",
    "autopilot_taken": (
        "a .waypoints file does not name its autopilot: it is taken to be for {autopilot} (--autopilot)"
    ),
    "taken_for_no_vtol": (
        "the file has items of a VTOL (command {command}), which flies on its wing between them, and does not say for "
        "which vehicle it is: say it (--autopilot arduplane; arducopter, if it is a multicopter's)"
    ),
    "file_not_read": "not read, and not on this page: {why}",
    "plan_without_autopilot": "the file does not say for which autopilot it is: it was read for {autopilot}",
    "plan_rally_points_unread": "the file's {keys} was not read; {cure}",
    "plan_for_other_kind": "the file is for a {kind}, and missions for {autopilot} are judged as multicopters fly them",
    "plan_fence_unread": "the file's {keys} is not read: {cure}",
    "plan_breach_return_unread": "the file's fence has a breach return point, which was not read",
    "plan_keys_unread": "these keys of the file were not read: {keys}",
    "plan_list_not_sent": ("the file's {key_of_list} ({count} {count:item|items}) is not sent: {option} sends it, too"),
    "plan_list_not_compared": (
        "the file's {key_of_list} ({count} {count:item|items}) is not compared with the list on board: the mission "
        "alone is"
    ),
    "complex_item_read": (
        "{entry} is a {kind}: it was read as the {count} {count:item|items} that it {landing:stands for|holds}"
    ),
    "altitude_shown_is_not_sent": (
        "its Altitude of {shown_m:height} is not the one that is sent, params[6] {sent_m:height}"
    ),
    "altitude_mode_is_not_sent": (
        "its AltitudeMode {shown} says another reference of the altitude than frame {frame}, which is sent"
    ),
    "item_without_place": "{entry} has no place: it was read as 0, 0, which ArduPilot takes for 'here'",
    "fence_without_heights": ("a fence has no height: {names} would be forbidden from the ground to the sky on board"),
    "fence_leaves_out": ("a fence has no height: {names} {names:is|are} left out of it, having a floor or a ceiling"),
    "fence_of_one_piece": (
        "the keep-in areas lie apart in {count} pieces: the fence is of the piece around home, which no flight leaves"
    ),
    "fence_areas_without_heights": (
        "a fence has no height: it keeps the aircraft in {names} from the ground to the sky; only the check knows "
        "their floors and ceilings"
    ),
    "fence_area_wider": (
        "the keep-in areas have {given} corners, more than the autopilot stores: its fence has {corners}, and is drawn "
        "around them, larger by up to {wider_m:distance}"
    ),
    "fence_circles_inside": "{names} {names:lies|lie} inside another circle of the fence",
    # -- no-fly zones: how their files were read, what of them is not used, and what each zone has of its own --
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
    "zone_limits_empty": "an empty AL or AH is no limit: these zones count from the ground up, or without end",
    "zone_limits_not_understood": ("these zones are understood in part: they count from the ground up without end"),
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
    "zones_of_other_kinds": "not used, because the mission uses other kinds alone ({kinds})",
    "zones_restrict_nothing": "not used, because their kind restricts nothing",
    "zones_authorised": "not used, because the mission says that it is authorised to enter them",
    "zones_out_of_hours": "not used, because they do not apply in the hours of the mission ({hours})",
    "zones_unused_far_away": "not used: {count} further {count:zone|zones} far from the mission",
    "zones_left_out": "left out: {count} {count:zone|zones} of files, too far away to matter",
    "zone_not_understood": "{where}: {why}",
    "zones_not_understood_far": "not understood, and too far from the mission to matter",
    "zone_skipped": "left out, because it is not understood: {where}: {why}",
    "zones_skipped": "left out, because their outlines are not understood",
    "shapes_ignored": "left out, because these are {kind}",
    # -- how a file was read --
    "fence_areas_joined": (
        "the {count} inclusion areas of the fence are joined: a flight may be in any of them (by default ArduPilot's "
        "own fence demands to be in all of them)"
    ),
    "holes_are_no_fly": "{count} {count:hole|holes} in polygons counted as no-fly",
    "terrain_records_unused": "not used, because they draw terrain: {records}",
    "fence_return_points_unused": "not used: {count} {count:point|points} to which a fence sends the aircraft",
    "tracks_unused": "not used: {count} {count:track or way point|tracks and way points} of a mission",
    "pictures_unused": "not used: {kinds}",
    "gdal_warns": "GDAL warns: {warning}",
    "converted_to_wgs84": "converted from {crs} to WGS 84 (good to {accuracy_m:distance})",
    "converted_to_wgs84_somehow": "converted from {crs} to WGS 84 (accuracy unknown)",
    # -- terrain: its files, what is unknown or differs in them, and what its heights mean --
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
    "format_of_other_version": "its format is version {version}, not {wanted}",
    "spacing_differs": "its spacing is {spacing_m:distance}, and most blocks have {most_m:distance}",
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
    # -- flight logs and on the energy model that is fitted to them --
    "log_damaged": "{log} is damaged in places, which were passed over",
    "places_of_receiver": "no vehicle_global_position, so the receiver's own places were taken, {topic}",
    "places_of_gps": "no POS messages, so the GPS's own places were taken",
    "power_of_system_status": "no BATTERY_STATUS, so SYS_STATUS was taken",
    "lines_passed_over": "passed over {count} {count:line|lines} without numbers",
    "slopes_in_wind": (
        "with winds and gusts of up to {wind_m_s:speed.1} behind it, it climbs {climb_deg:g}° and descends "
        "{descent_deg:g}° over ground at most, at its slowest speed of {speed_m_s:speed}: the path keeps to that"
    ),
    "wind_unknown": "no log tells the wind: metres over ground are taken for those through the air",
    "wind_counted": "metres are those through the air, in a wind of {wind_m_s:speed.1} as the log tells it",
    "wind_counted_of_some": (
        "metres are those through the air, in a wind of {wind_m_s:speed.1} as the log tells it; {silent} of {logs} "
        "logs tell none"
    ),
    "nearly_all_climbs": "the vertical metres are nearly all climbs: R1 is theirs alone",
    "nearly_all_descents": "the vertical metres are nearly all descents: R1 is theirs alone",
    "up_and_down_differ": (
        "a metre up costs about {up_j_per_m:.0f} J and a metre down {down_j_per_m:.0f} J; R1 is one number for both, "
        "good for missions that climb as much as they descend"
    ),
    "fit_holds_at_one_speed": (
        "this fit holds at {speed_m_s:speed.1} through the air, and says nothing of other speeds"
    ),
}
