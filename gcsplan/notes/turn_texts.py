"""Sentences on corners and turns: where a vehicle begins them, and what of them is not judged."""

TEXTS = {
    "arcs_unread": (
        "the arcs of {radius_m:distance} that {vehicle} flies at its corners are not judged: {autopilot} begins a turn "
        "by parameters that the mission does not hold"
    ),
    "arcs_too_banked": (
        "turns of {radius_m:distance} at {speed_m_s:speed} need a bank of {bank_deg:.0f}°, and ArduPlane's "
        "ROLL_LIMIT_DEG is {most_deg:g}°: the arcs that it flies are wider, and not judged"
    ),
    "l1_period_out_of_range": (
        "NAVL1_PERIOD is {period_s:g} s, and ArduPlane takes {least_s:g} to {most_s:g} s: the arcs that it flies at "
        "its corners are not judged"
    ),
    "turns_late": "flies {past_m:distance.0} past its way point before it turns (param3): that is not judged",
    "corner_in_terrain_frame": "what a fixed wing flies at a corner in the terrain frame is not judged",
    "corner_turns_back": "what a fixed wing flies at a corner that turns by {turn_deg:.0f}° is not judged",
    "arcs_too_long": (
        "arcs of {radius_m:distance} take {arcs_m:distance.0} of the leg to item {leg}, which is {leg_m:distance.0} "
        "long: what is flown there is not judged"
    ),
    "turn_too_early": (
        "the turn begins {begins_m:distance.0} before the end of the leg to item {leg}, which is {leg_m:distance.0} "
        "long: what is flown there is not judged"
    ),
    "turns_as_arcs": (
        "turns are judged as arcs of {radius_m:distance} that begin at the acceptance radius of their way point; that "
        "the aircraft follows them within {key:track_error_m} {error_m:g} is assumed (NAVL1_PERIOD, wind; a bank of "
        "{bank_deg:.0f}° at {speed_m_s:speed}){off}"
    ),
    "turns_off_arcs": (
        "; in calm air ArduPlane with NAVL1_PERIOD {period_s:g} is up to {wander_m:distance.0} off them{wider:, so the "
        "sharpest are judged wider|}"
    ),
    "corners_cut": (
        "corners are cut within WPNAV_RADIUS {radius_m:distance}, {read:read from the vehicle|the default}"
    ),
    "reached_within_default": (
        "it gives no acceptance radius: it counts as reached within NAV_ACC_RAD {radius_m:distance}, {read:read "
        "from the vehicle|the default}"
    ),
    "turn_begun_by_default": (
        "it gives no acceptance radius: its turn is judged as begun by WP_RADIUS {radius_m:distance}, {read:read "
        "from the vehicle|the default}"
    ),
    "arc_begun_by_default": (
        "it gives no acceptance radius: its turn is judged as begun by WP_RADIUS {radius_m:distance}, "
        "{radius_read:read from the vehicle|the default}, and NAVL1_PERIOD {period_s:g} s, {period_read:read from the "
        "vehicle|the default}"
    ),
}
