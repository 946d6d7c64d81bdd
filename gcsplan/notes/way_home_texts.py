"""Sentences on the way home: verdict, what to set, facts, from where and why; returns that join the mission."""

WAY_HOME_TEXTS = {
    "and_also": "{one} and {other}",
    "and_then": "{one}; {other}",
    # -- the verdict in a sentence -----------------------------------------------------------------------------------
    "path_safe": "path safe",
    "path_unsafe": "path UNSAFE",
    "path_not_judged": "path not judged in full",
    "return_not_judged": "{path}, return not judged",
    "return_safe": "{path}; safe return from all of it",
    "no_return_from_point": "{path}; no safe return from a point of it",
    "no_return_from_part": "{path}; no safe return from {no_return_m:reach} of it",
    "verdict_of_some": "{count} {count:vehicle|vehicles}: {verdict}",
    "why_not_judged": "{verdict}: {why}",
    "no_return_at_item": "{verdict}, at item {seq}",
    "no_return_for_battery": "{verdict} (battery)",
    "no_return_for_battery_from": "{verdict} (battery: from {short_m:reach})",
    # -- what to set -------------------------------------------------------------------------------------------------
    "set_route": "set {setting}",
    "set_altitude": "set {setting}: then {then}",
    "set_with_rally_points": (
        "set {setting}, with {count} {count:rally point|rally points} on board (--rally): then {then}"
    ),
    "then_return_safe": (
        "safe return from all of it{legal:, within all limits|}{above}{rally:, the battery not counted|}{part:, as far "
        "as it was judged|}"
    ),
    "then_no_return": (
        "no safe return from {left_m:reach} of it{battery: (battery)|}{above}{rally:, the battery not "
        "counted|}{part:, as far as it was judged|}"
    ),
    "above_max_agl": ", but above {key:max_agl_m} ({max_agl_m:height}) over home",
    "return_by_altitude": "return at {height_m:height} above home{above}{rally} ({setting})",
    "with_rally_points": ", with {count} {count:rally point|rally points} on board (--rally)",
    "return_by_mission": ("{key:return_route}: mission, back along the track (ArduCopter 4.6 or later, and {setting})"),
    "land_earlier": "goal at {lat:.6f}, {lon:.6f}, {before_m:reach} earlier{with_change}",
    "and_that": ", with {change}",
    "return_proposal": "{change}: {leaves}",
    "proposal_leaves": "no safe return from {left_m:reach} of it",
    "proposal_leaves_nothing": "safe return from all of it",
    "proposals_tried": "tried for the way home, the best first:{proposals:lines}",
    "path_back_makes_safe": (
        "{key:return_route}: mission writes a return path back along the track, which makes every return safe: needs "
        "ArduCopter 4.6 or later, and {setting}"
    ),
    "path_back_helps": (
        "{key:return_route}: mission writes a return path back along the track, which makes all but {left_m:reach} of "
        "it safe: needs ArduCopter 4.6 or later, and {setting}"
    ),
    # -- facts -------------------------------------------------------------------------------------------------------
    "judged_at": "{rel_home_m:height} above home, {assumed:the autopilot's default|as given}",
    "joined_to_path": "joined to the mission's return path (item {items})",
    "joined_to_landing": "joined to the mission's landing sequence (item {items})",
    "no_single_altitude": "no single return altitude is, from all of the path",
    "from_altitude": "from all of the path at {lowest_m:height.1 up trimmed} or more above home",
    "between_altitudes": (
        "from all of the path at {lowest_m:height.1 up trimmed} to {highest_m:height.1 down trimmed} above home"
    ),
    "lowest_on_return": (
        "{agl_m:height.0 down} above ground, on the return from {unit:far} {at_m:far.2 bare} (item {seq})"
    ),
    "lowest_below_ground": (
        "{below_m:height.0 up} below ground, on the return from {unit:far} {at_m:far.2 bare} (item {seq})"
    ),
    "rally_point": ("{lat:.7f}, {lon:.7f}, {rel_home_m:height.0 up} above home: {why}; nearest for {serves_m:reach}"),
    "where_mission_ends": "where the mission ends",
    "under_mission": "under the mission, ground slopes {slope_percent:.0f} %",
    "battery_enough": (
        "enough from everywhere: flight and return use {most_percent:.0f} % at most, from {unit:far} "
        "{at_m:far.2 bare}; {usable_percent:.0f} % may be used"
    ),
    "point_of_no_return": (
        "point of no return at {unit:far} {at_m:far.2 bare} (item {seq}, {lat:.6f}, {lon:.6f}): from beyond it flight "
        "and return use up to {most_percent:.0f} %, and {usable_percent:.0f} % may be used"
    ),
    # -- from where, and why -----------------------------------------------------------------------------------------
    "from_stretch": "from {stretch}",
    "from_one_place": "{unit:far} {from_m:far.2 bare} ({items}): {why}",
    "from_part": "{unit:far} {from_m:far.2 bare} to {to_m:far.2 bare} ({items}): {why}",
    "one_item": "item {seq}",
    "several_items": "items {first} to {last}",
    "altitude_helps": (
        "{stretch}; {legal:within all limits|safe} from there at {lowest_m:height.1 up trimmed} above home"
    ),
    "no_altitude_helps": "{stretch}; no return altitude is {legal:within all limits|safe} from there",
    "no_altitude_helps_because": (
        "{stretch}; no return altitude is {legal:within all limits|safe} from there: {because}"
    ),
    "outside_limit_from": (
        "from {length_m:reach} of the path the return hits nothing but breaks a limit; first from {first}"
    ),
    "outside_limit_at": "from a point of the path the return hits nothing but breaks a limit; first from {first}",
    "return_fails": "the return {does}",
    "needs_differ": "what one part of it needs is too high for another",
    "at_another_altitude": "at another altitude it {does}",
    "does_above_ceiling": "rises above {key:max_amsl_m}",
    "does_above_max_agl": "comes higher above ground than {key:max_agl_m}",
    "does_over_unknown_ground": "leads over ground that is unknown to the terrain model",
    "does_brake_into_ground": "brakes into ground ahead, below {top_m:amsl.0 up}",
    "does_meet_ground": "meets ground{at} and would clear it at {top_m:amsl.0 up}",
    "does_meet_ground_on_climb": "meets ground{at} before it has climbed over it, to {top_m:amsl.0 up}",
    "does_near_ground": "comes nearer than {key:min_agl_m} to ground{at} and would keep it at {top_m:amsl.0 up}",
    "does_near_ground_on_climb": (
        "comes nearer than {key:min_agl_m} to ground{at} before it has climbed over it, to {top_m:amsl.0 up}"
    ),
    "at_place": " at {lat:.6f}, {lon:.6f} ({amsl_m:amsl.0})",
    "does_meet_zone": "meets no-fly zone “{zone}”{height} or its clearance",
    "does_leave_keep_in": "leaves {areas}{height} or comes too near to the edge",
    "zone_without_top": " (no top)",
    "zone_from": " (from {bottom_m:amsl.0} up)",
    # -- returns that join the mission -------------------------------------------------------------------------------
    "joining_fails": (
        "the return, which joins the mission at item {join}, {does} at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.0}"
    ),
    "joining_not_clear": "the return is not clear",
    "joins_landing": (
        "the return, which joins the mission at item {join}, leads straight to a landing, and how is not known"
    ),
    "joins_short_legs": (
        "the return, which joins the mission at item {join}, is not on its line again before the landing: the legs "
        "behind are too short"
    ),
    "joins_too_steeply": (
        "the return, which joins the mission at item {join}, may be too short for its climb or descent"
    ),
    "joins_into_limit": (
        "the return, which joins the mission at item {join}, {descends:descends|swings wide} there into what the "
        "limits forbid"
    ),
    "way_near_ground": "comes nearer than {key:min_agl_m} to ground",
    "way_near_rising_ground": "comes too near to rising ground",
    "way_over_unknown_ground": "leads over ground that is unknown to the terrain model,",
    "way_climbs_too_steeply": "climbs more steeply than {key:max_climb_deg}",
    "way_descends_too_steeply": "descends more steeply than {key:max_descent_deg}",
    "way_meets_ground": "meets ground",
    "way_breaks_limit": "breaks a limit",
    "way_leaves_keep_in": "leaves {areas} or comes too near to the edge",
    "way_meets_zone": "meets no-fly zone “{zone}”",
    "way_meets_clearance": "meets no-fly zone “{zone}” or its clearance",
    "nothing_to_join": "the mission holds neither {one} nor {other}: there is nothing that a return joins",
    "jump_decides_join": "it jumps: what a return joins depends on the jumps that are left",
    "join_unknown_on_path": "the return path holds it, and how it is joined there is not known",
    "join_distance_unknown": "how near it is depends on its frame or its place, which are not known",
    "join_leads_nowhere": "nothing follows it that a return could fly to",
    "join_without_item": "no item that moves the vehicle follows the start that a return joins",
    "join_not_way_point": "a return joins it, and only way points and landings with a place are judged",
    "join_without_landing": "a return joins it, and what follows does not end with a landing",
    "join_not_followed": "a return joins it, and the mission could not be followed there",
    # -- notes, and what is not judged -------------------------------------------------------------------------------
    "mission_not_followed": "the mission could not be followed",
    "home_not_on_ground": "the ground at home is unknown: give terrain that knows it, or another home",
    "return_too_windy": (
        "the declared winds reach {wind_m_s:speed.1 up} at heights of the return{gusts}, and the vehicle does not "
        "advance against them: return lower, or fly in less wind"
    ),
    "px4_joins_unread": (
        "PX4's returns along the mission (RTL_TYPE above 0) are not judged: only its return straight home is"
    ),
    "return_path_by_version": ("DO_RETURN_PATH_START: ArduCopter 4.6.0 and ArduPlane 4.6.2 are the first to know it"),
    "fence_returns_straight": "a breach of the fence (FENCE_ACTION) and RTL itself still return straight home",
    "mission_too_long": (
        "the mission is too long to look at all of it closely: unsafe stretches may be drawn too long"
    ),
    "terrain_too_fine": (
        "the terrain is too fine to look at all of it closely: unsafe stretches may be drawn too long"
    ),
    "return_altitude_assumed": (
        "the return is judged at {rel_home_m:height} above home, the default of {parameter}: write the vehicle's own "
        "as {key:rtl_rel_home_m}"
    ),
    "return_from_flight": "a plane's return is judged from its flight, not from its take-off and landing",
    "return_leads_on": (
        "{command}: the return leads on to it, by RTL_AUTOLAND; only the flight straight home is judged: say "
        "{key:return_route}: mission for RTL_AUTOLAND 2 or 4, or {key:return_route}: straight for 3"
    ),
    "clear_above_ceiling": (
        "every clear return altitude rises above {key:max_amsl_m}: the lowest that is clear from all of the path, "
        "{lowest_m:height.1 up trimmed} above home; it allows {most_m:height.0 down} above home"
    ),
    "clear_above_low_ceiling": (
        "every clear return altitude rises above {key:max_amsl_m}: the lowest that is clear from all of the path, "
        "{lowest_m:height.1 up trimmed} above home; home is not below it"
    ),
    "no_rally_point_helps": "no rally point under the mission makes more of it safe",
    "look_at_rally_points": (
        "look at each rally point before it is used: the terrain model knows no trees, wires, people or owners"
    ),
    "rally_points_unjudged": (
        "returns to the file's rally points are not judged beside a return along the mission: leave the points out"
    ),
    "rally_points_of_px4": "the rally points are judged with RTL_TYPE 0: the nearest of home and rally points",
    "rally_points_of_ardupilot": (
        "the rally points are judged with RALLY_INCL_HOME 1 and RALLY_LIMIT_KM 0 (or {limit_km:.1f} at least): the "
        "nearest of home and rally points"
    ),
}
