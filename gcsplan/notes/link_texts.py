"""Sentences on vehicles on their links: what is on board, what was sent."""

LINK_TEXTS = {
    # -- a vehicle that a list is sent to: its state, its parameters, its terrain, and the link to it --
    # -- the link, and the vehicle's state --
    "sends_from_another_port": (
        "the link sends from port {port}, because a program uses {wanted_port} already: a PX4 that has heard that "
        "program answers it alone; end it, or give a port to send from ({endpoint} as udpout:HOST:PORT,LOCAL)"
    ),
    "autopilot_not_checked": (
        "the vehicle calls itself {what}; the mission is written for {autopilot}, which could not be checked"
    ),
    "vehicle_type_not_told": "the vehicle does not say whether it is what {autopilot} flies",
    "vehicle_state_not_told": "the vehicle does not report its state: whether it is ready could not be checked",
    "wind_as_declared": (
        "the vehicle estimates a wind of {speed_m_s:speed.1} from {from_deg:.0f}°, which is within the plan's "
        "({declared})"
    ),
    "wind_not_as_declared": (
        "the vehicle estimates a wind of {speed_m_s:speed.1} from {from_deg:.0f}°, {away_m_s:speed.1} from the nearest "
        "one that the plan counts ({declared}): times, energy and ways home do not hold in it; declare it and plan "
        "again, or wait"
    ),
    "wind_not_estimated": "the vehicle gives no estimate of the wind to hold beside the declared one",
    "vehicle_in_trouble": "the vehicle reports that it is {state}",
    "armed_as_allowed": "the vehicle is armed, which was allowed",
    "only_mavlink1": (
        "only MAVLink 1 comes back from the vehicle: set SERIALn_PROTOCOL 2 (ArduPilot) or MAV_PROTO_VER 2 (PX4) on "
        "board, or use a radio or router that passes MAVLink 2"
    ),
    "capabilities_not_told": "the vehicle does not report its capabilities",
    "item_int_not_told": "the vehicle does not say that it takes MISSION_ITEM_INT",
    "terrain_ability_not_told": (
        "the mission has altitudes above terrain, and the vehicle does not say that it knows terrain"
    ),
    "px4_may_miss_way_points": (
        "the vehicle is PX4 {version}, which may change its altitude at the beginning of a leg, miss the way point and "
        "fly on (upstream issue 28507)"
    ),
    "position_not_told": "the vehicle reports no position: whether it stands at the start could not be checked",
    "home_on_board_elsewhere": (
        "the vehicle's home is {away_m:distance.0} from the mission's start and {off_m:height.1} {above:above|below} it"
    ),
    "home_on_board_elsewhere_counts": (
        "the vehicle's home is {away_m:distance.0} from the mission's start and {off_m:height.1} {above:above|below} "
        "it; its relative altitudes count from there if it is not armed at the start"
    ),
    "changed_after_read_back": "after the read-back: {outcome}",
    "armed_during_upload": "the vehicle was armed by somebody during the upload",
    # -- terrain on board --
    "terrain_parts_not_sent": (
        "{parts} parts of {blocks} blocks that the vehicle asks for are not sent, because the terrain model does not "
        "know their ground (the first in {tile}): it asks for them again and again, and does not arm a mission in the "
        "terrain frame before it has them; give a larger DEM"
    ),
    "terrain_requests_strange": "{count} requests for terrain were for no block of ArduPilot's grid",
    "terrain_not_loaded": "{why}",
    "terrain_off_on_board": ("TERRAIN_ENABLE is 0 on board: it knows no terrain and does not fly the terrain frame"),
    "terrain_spacing_not_judged": (
        "TERRAIN_SPACING is {spacing_m:g} on board, and {least_m} to {most_m} m are judged: set TERRAIN_SPACING {set_m}"
    ),
    "terrain_incomplete_on_board": (
        "the vehicle has no terrain yet at {lacking} of {places} places under the mission; it does not arm before it "
        "has: gcsplan terrain serve --until-loaded gives it all"
    ),
    "terrain_differs_on_board": (
        "the vehicle reads terrain {off_m:height.1} off that of the mission at {lat_deg:.6f}, {lon_deg:.6f}: it holds "
        "terrain from elsewhere (remove it from its SD card), or shifted it when it was armed (restart it)"
    ),
    # -- parameters on board --
    "no_parameter_read": (
        "no parameters could be read: failsafe, return and fence settings of {autopilot} were not compared"
    ),
    "parameter_not_expected": "{name} is {value:g} on board, {wanted:g} is expected",
    "expected_parameter_unread": "{name} could not be read, {wanted:g} is expected",
    "parameter_is_no_number": "{name} on board is no number: it was not compared",
    "parameter_not_assumed": (
        "{name} is {value:.6g} on board, and {assumed} is assumed ({why}): set {name} {wanted:.10g}"
    ),
    "no_failsafe": "no failsafe action on board for {failsafes}",
    "no_fence_parameter_read": "no parameters could be read: whether the fence is enforced is not known",
    "fence_not_enforced": "FENCE_ENABLE is 0 on board: the fence is kept and not enforced until it is enabled",
    "fence_enforced_by_itself": "FENCE_AUTOENABLE is {value:g} on board: the fence is enforced from {moment} on",
    "fence_enables_others": "{fence}; enabling it also puts into force {others}",
    "fence_type_unread": ("what FENCE_TYPE says, which could not be read (a circle around home, a highest altitude)"),
    "circle_around_home": "the circle of {at} around home (FENCE_RADIUS; FENCE_TYPE {kinds:g})",
    "ceiling_above_home": "the ceiling at {at} above home (FENCE_ALT_MAX; FENCE_TYPE {kinds:g})",
    "floor_above_home": "the floor at {at} above home (FENCE_ALT_MIN; FENCE_TYPE {kinds:g})",
    "metres_on_board": "{at_m:height}",
    "metres_on_board_unread": "a height or radius that could not be read",
    "fence_type_without_polygons": (
        "FENCE_TYPE is {kinds:g} on board: polygons and circles (4) are not among the fences in force"
    ),
    "fence_breach_only_reported": "the fence's action on board is none: a breach is only reported",
    "mission_above_fence": (
        "the mission goes {reach_m:height.0 up} high and the fence on board ends at {end_m:height} ({name})"
    ),
    "mission_beyond_fence": (
        "the mission goes {reach_m:distance.0 up} far and the fence on board ends at {end_m:distance} ({name})"
    ),
    "return_altitude_unread": "the return altitude on board could not be read",
    "return_not_checked": (
        "after a failsafe the return is at {rel_home_m:height} above home ({name}); that return was not checked"
    ),
    "return_at_another_altitude": (
        "the return is at {rel_home_m:height} above home ({name}), but was checked at {checked_m:height}: set {setting}"
    ),
    "return_altitude_advised": ("the return is at {rel_home_m:height} above home ({name}), as judged: set {setting}"),
    "return_waits_otherwise": (
        "RTL_LOIT_TIME is {value:g} on board: a return waits {waits_s:g} s over home before it descends, and times and "
        "battery count {counted_s:g} s"
    ),
    "hovers_at_descend_altitude": (
        "RTL_LAND_DELAY is {value:g} on board: a return ends in a hover at RTL_DESCEND_ALT, until the battery is empty "
        "or it is landed by hand; it was judged as a landing, which RTL_LAND_DELAY 0 makes"
    ),
    "hovers_over_home": (
        "{name} is {value:g} on board: a return ends in a hover {rel_home_m:height} above home, until the battery is "
        "empty or it is landed by hand; it was judged as a landing, which {name} 0 makes"
    ),
    "return_type_not_judged": (
        "RTL_TYPE is {value:g} on board: the return is not straight home (or to the nearest rally point), as it is "
        "judged: set RTL_TYPE 0"
    ),
    "return_cone_not_judged": (
        "RTL_CONE_ANG is {value:g} on board: within RTL_MIN_DIST of home the return may be lower than with "
        "{judged_deg:g}°, as it is judged: set RTL_CONE_ANG {judged_deg:g}"
    ),
    "return_route_unread": "{names} could not be read: whether the return joins the mission is not known",
    "return_route_all_unread": "none of {names} could be read: whether the return joins the mission is not known",
    "return_joins_mission": (
        "{names} is {value:g} on board: the return joins the mission at {start}, and was judged straight home: set 1 "
        "or 2 (RTL), or judge it with {key:return_route}: mission"
    ),
    "return_joins_no_mission": (
        "{settings} on board: such a return does not join the mission at {start}, as it was judged: set {value:g} "
        "(Auto RTL)"
    ),
    "plane_does_not_arm": (
        "RTL_AUTOLAND is 0 on board: with {start} in its mission ArduPlane does not arm: set RTL_AUTOLAND {wanted:g}"
    ),
    "plane_returns_otherwise": (
        "RTL_AUTOLAND is {value:g} on board, and the return was judged as with {wanted:g}: set RTL_AUTOLAND {wanted:g}"
    ),
    "plane_return_leads_on": (
        "RTL_AUTOLAND is {value:g} on board: the return leads on to {start}, and was judged straight home: set "
        "RTL_AUTOLAND 3, or judge it with {key:return_route}: mission"
    ),
    "pitch_not_flown": (
        "TECS_PITCH_MAX is {value:g} on board: with more than {flown_deg:g}° (0: with PTCH_LIM_MAX_DEG) an aircraft "
        "with power to spare rises further above its take-off's altitude than the {judged_m:height} that are judged "
        "unless {key:climb_out_m_s} tells its climb: set {flown_deg:g}, or give {key:climb_out_m_s}"
    ),
    "lean_angle_unread": (
        "the largest lean angle on board could not be read: {speed_m_s:speed.1} need about {needs_deg}°"
    ),
    "lean_angle_too_small": (
        "{name} is {value:g} on board: it leans by {lean_deg:g}° at most, which allows about {most_m_s:speed.1}, and "
        "{speed_m_s:speed.1} are commanded: set {name} {wanted:g}, or plan with {key:lean_angle_deg}: {lean_deg:g}"
    ),
    "velocity_too_small": (
        "MPC_XY_VEL_MAX is {value:g} on board: it flies no faster, and {speed_m_s:speed.1} are commanded: set "
        "MPC_XY_VEL_MAX {wanted}, or plan with speed_m_s up to {value:g}"
    ),
    "arrives_later": "it arrives later than planned: {reasons}",
    "slower_than_planned": "{name} is {value:g} on board, and {wanted:g} was planned with ({planned_key})",
    "returns_slower_than_planned": (
        "MPC_XY_CRUISE is {value:g} on board, and a return at {speed_m_s:speed} was planned with"
    ),
    # -- what a mission was judged with, by parameter --
    "assumed_speed_or_interrupted": "the mission's speed: one that was interrupted goes on at this parameter's",
    "assumed_return_speed": "the speed of the return",
    "assumed_motion": "{motion:key}, in all times",
    "assumed_last_ten_metres": "{key:land_m_s}, the landing's last 10 m",
    "assumed_last_metres": "{key:land_m_s}, the landing's last metres",
    "assumed_landing_higher_up": "a landing's speed higher up: 0 is {key:descent_m_s}",
    "assumed_slow_landing": "from where on a landing is slow",
    "assumed_slower_landing": "from where on a landing is slower",
    "assumed_acceleration": "{key:accel_m_s2}, in all times and in how far a return runs on",
    "assumed_key": "{motion:key}",
    "assumed_in_corners": "{key:corner_accel_m_s2}, in corners; 0 is twice the acceleration",
    "assumed_over_acceleration": "{key:corner_accel_m_s2} over {key:accel_m_s2}, in corners",
    "assumed_corners_begin": "where corners begin",
    "assumed_return_above_home": "returns are judged above home, not above terrain",
    "assumed_return_cone": "how low a return may be near home",
    "assumed_return_no_higher": "a return is no higher than was judged",
    "assumed_return_lands": "a return lands",
    "assumed_return_waits": "how long a return waits over home",
    "assumed_airspeed": "the airspeed of the climb-out, of a return, and of a mission that was interrupted",
    "assumed_fastest": "the fastest speed of the plan",
    "assumed_slowest": "the slowest speed of the plan",
    "assumed_circles": "the radius of circles that say none, and over home",
    "assumed_circle_over_home": "the radius of the circle over home",
    "assumed_turns_begin": "how early turns begin at way points that say no radius",
    "assumed_settling_time": "how fast it settles on a leg",
    "assumed_settling": "how it settles on a leg",
    "assumed_pitch": "how far a climb-out rises too high",
    "assumed_mission_speed": "the mission's speed",
    "assumed_return_speed_whatever": "the speed of the return, whatever the mission's is",
    "assumed_first_metres": "the speed of a take-off's first metres",
    "assumed_reached": "where items without a radius count as reached",
    "assumed_reached_height": "the height at which an item counts as reached",
    "assumed_return_straight": "returns are judged straight home",
    "assumed_terrain_margin": "how far off its height above ground it slows down",
    "assumed_lean": "{key:lean_angle_deg}: {speed_m_s:speed.1}, and forecasts in wind",
    "assumed_return_altitude": "the return altitude, above home{judged:, as judged|}",
    "assumed_return_turns": "turns of the return",
    "assumed_bank": "the bank of its turns at {speed_m_s:speed.1}, and a tenth to steer",
    "assumed_lift": (
        "{vtol:take-off and landing are vertical, and the way between is flown on the wing|take-off and landing are on "
        "the wing}"
    ),
    "assumed_brakes": "how a VTOL brakes for its landing",
    "after_radio_loss": "loss of radio control",
    "after_ground_station_loss": "loss of the ground station",
    "after_low_battery": "a low battery",
    "after_critical_battery": "a critical battery",
    "after_long_failsafe": "a long failsafe",
    "assumed_failsafe": "{after} makes it return{by_mission: along the mission|}; 0 does nothing",
    "assumed_lost_position": "a lost position makes it land, wherever it is",
    "assumed_highest_place": "the highest place of the flight above home, errors counted",
    "assumed_return_below_fence": "a return at {returns_m:height} keeps FENCE_MARGIN below this",
    "assumed_fence_margin": "how far below FENCE_ALT_MAX a return keeps",
    "assumed_lowest_place": "the lowest place of the flight, from home, errors counted",
    "assumed_farthest_place": "the farthest place of the flight from home, errors counted",
    "assumed_fence_action": "a breach of a fence makes it return",
    # -- why the mission cannot be flown as it was judged with what is on board --
    "return_required_and": "a safe return is required, and {why}",
    "return_required_but": "a safe return is required: {why}",
    "return_required_elsewhere": (
        "a safe return is required; it was judged at {judged_m:height} above home, and this vehicle returns at "
        "{returns_m:height}: set {setting}"
    ),
    "parameters_unanswered": (
        "{names} could not be read from the vehicle, and no answer is not the default: try again, nearer or with a "
        "longer --timeout"
    ),
    "parameters_not_judged": (
        "it was judged with other values, and cannot be judged with these{allowed:; --allow-parameters takes that|}"
        "{off:lines}"
    ),
    "breaks_limits_on_board": "{found:rows}",
    "not_judged_on_board": "not judged: {why}",
    "return_runs_farther": "a safe return is required, and it runs on farther than was judged{off:lines}",
    "flight_takes_otherwise": (
        "the flight takes {takes_s:.1f} s instead of {told_s:.1f} s ({late_s:+.1f} s)"
        "{leans:, for ArduCopter before 4.5 takes corners with all that its lean allows|}; --allow-parameters takes "
        "that{off:lines}"
    ),
    "too_near_on_board": "with these parameters {near}{off:lines}",
    "breaches_own_fence": "the mission would breach its own fence:{found:lines}",
    "not_judged_in_time": (
        "it could not be judged with this vehicle's parameters within {timeout_s:g} s: give more --timeout"
    ),
    # -- an upload or a comparison, by what was done before and after it --
    "fence_on_board": "a fence of {items} {items:item|items} is on board too, read back and compared",
    "rally_on_board": "{items} {items:rally point is|rally points are} on board too, read back and compared",
    "judged_again_safe": "the mission on board is judged again: safe",
    "positions_shifted": (
        "{items} {items:item differs by|items differ by up to} {most_m:distance.3}; judged again: {safe:safe|not safe}"
    ),
    "positions_cut": (
        "{items} {items:item differs by|items differ by up to} {most_m:distance.3}, as {sender} write positions; "
        "judged again: {safe:safe|not safe}"
    ),
}
