"""Sentences on what an autopilot does with a mission's items, and on what of it is not judged."""

TEXTS = {
    # -- home --------------------------------------------------------------------------------------------------------
    "home_ground_unknown": "the ground at home ({lat:.7f}, {lon:.7f}) is unknown",
    "home_height_differs": (
        "home is given as {given_m:amsl.1} and the terrain model says {ground_m:height.1} there: the terrain model was "
        "taken"
    ),
    "home_has_two_heights": (
        "the ground at home ({lat:.7f}, {lon:.7f}) is not one number: by the terrain's own files it lies between "
        "{low_m:amsl.1 down} and {high_m:amsl.1 up}, and altitudes count from it; what helps is a home away from where "
        "they differ, terrain of one file there, or {key:altitude_error_m} of {spread_m:height.1} and more"
    ),
    # -- order of the items ------------------------------------------------------------------------------------------
    "flies_nowhere": "the mission flies nowhere: it has no item that moves the vehicle; add one",
    "comes_after_landing": "it comes after the landing: what it does is not judged; remove it",
    "returns_by_itself": (
        "after the last item ArduPlane returns home by itself (RTL): that return is not judged; end the mission with a "
        "landing, a loiter or an RTL"
    ),
    "jumps_back_into_return": (
        "items {first} to {last}: a jump leads back from what only a return leads to: what follows is not judged; end "
        "what a return leads to with a landing"
    ),
    "too_many_jumps": (
        "the mission has {count} jumps, and ArduPilot counts {most} on small boards and passes the rest; write some "
        "rounds out"
    ),
    "too_many_steps": ("the jumps lead through more than {most} items: the rest is not judged; give them fewer rounds"),
    "jump_target_missing": "it jumps to an item that the mission has not; correct its number",
    "jump_counted_by_version": (
        "it is reached again after its {rounds} jumps: ArduPilot before 4.7 skips it then, and 4.7 begins its count "
        "anew (MIS_OPTIONS bit 3 stops that), so how long it flies depends on the version; write the outer rounds out"
    ),
    "jump_flies_nothing": "it jumps to item {target} for ever and nothing is flown between them; remove it",
    "jumps_without_end": (
        "it jumps back to item {target} without end: its round is judged and counted once, what ends it (a pilot, a "
        "failsafe) is not judged{never}"
    ),
    "items_after_jump": "; the items after it, {first} to {last}, are never flown",
    # -- take-off ----------------------------------------------------------------------------------------------------
    "no_take_off": (
        "it is the first to fly to and there is no take-off before it: the way from home to it is not judged; put a "
        "take-off before it"
    ),
    "takes_off_elsewhere": "take-off lies {away_m:distance.0} from home: what PX4 does between is not judged",
    "takes_off_where_it_stands": (
        "take-off is written {away_m:distance.0} from home; ArduCopter takes off where it stands"
    ),
    "vtol_climbs_by_altitude": (
        "ArduPlane's VTOL take-off climbs by its altitude, whatever its frame, unless Q_OPTIONS says otherwise: only "
        "an altitude relative to home (frame 3) is judged"
    ),
    "runway_take_off": (
        "a runway take-off (NAV_TAKEOFF on ArduPlane) leaves straight ahead on a heading that the mission does not "
        "hold; a fixed wing with {key:turn_radius_m} is judged from its launch on"
    ),
    "climb_out_towards_next": ("it gives no place: the take-off is judged as launched towards the item after it"),
    "climb_out_unclear": (
        "a take-off of a fixed wing is judged where it has an altitude above home, and itself or the item after it a "
        "place to climb towards"
    ),
    "climb_out_straight": (
        "the take-off is judged as a straight climb at {climb_deg:g}° on a heading of {heading_deg:.0f}° over "
        "{run_m:distance.0}: launch it that way; ArduPlane holds the heading that it is launched on, and turns when it "
        "is high enough; times count {counted}"
    ),
    "climb_as_judged": "that climb: with power to spare it is seconds early ({key:climb_out_m_s})",
    "climb_as_given": "{climb_m_s:climb_rate} up",
    "climb_out_drifts": (
        "in a cross wind it drifts aside, by up to {drift_m:distance.0} for each m/s, as its nose holds the heading: "
        "launch into the wind, or let {key:track_error_m} hold that"
    ),
    "climb_out_circles": ("the take-off goes on in circles, judged as {reach_m:distance.0} wide all the way up"),
    "turns_early": (
        "it turns towards the next item as soon as it is high enough, so all straight ways there from the climb-out "
        "are judged"
    ),
    # -- on the way --------------------------------------------------------------------------------------------------
    "flown_unknown": (
        "what {autopilot} flies for command {command} is not judged: {why}; leave it out to have the rest judged"
    ),
    "splines_by_version": "splines are judged as ArduCopter 4.1 and later fly them",
    "arcs_by_version": "arcs are judged as ArduCopter 4.7 and later fly them; older ones refuse them on upload",
    "circle_by_default": "the circle is judged with {parameter} {radius_m:distance}, the default",
    "circle_widened": (
        "ArduPlane widens its circle of {radius_m:distance} in the thin air at {amsl_m:amsl.0} to about "
        "{flown_m:distance.0}; it is judged with {judged_m:distance.0 up}, for a hot day"
    ),
    "climb_rate_uncounted": "a rate of climb or descent for PX4 is not counted in the time",
    "waits_until_time": ("a wait until a time of day costs what is not known beforehand; give its seconds (param1)"),
    "hold_without_known_end": (
        "a hold of {hold_s} s (param1) has no end that is known (give its seconds): that is not judged"
    ),
    "reads_terrain_on_board": (
        "terrain-frame legs depend on the terrain data in the vehicle; judged as it reads this terrain, at posts every "
        "{spacing_m} m, with {error_m:height} of error"
    ),
    "no_ceiling": "{key:max_agl_m} is not set: nothing limits the height above ground",
    "ends_in_the_air": "the mission ends in the air: what becomes of the vehicle after its last item is not in it",
    "straight_legs_until": (
        "judged with straight legs, as PX4 until 1.17 flies them; later ones may change their altitude at the "
        "beginning of a leg and fly past way points (upstream issue 28507), so an upload to them is refused"
    ),
    # -- landing and return ------------------------------------------------------------------------------------------
    "precision_landing": (
        "a precision landing (param2) looks for its beacon, and where is not known (0 lands without it): that is not "
        "judged"
    ),
    "lands_as_wing": (
        "a descent as a fixed wing (param1) is flown as the autopilot likes (0 lands as a multicopter): that is not "
        "judged"
    ),
    "return_leads_to_landing": (
        "a return leads on to DO_LAND_START, by RTL_AUTOLAND (end with the landing itself): that is not judged"
    ),
    "runway_landing": (
        "a runway landing's glide (NAV_LAND on ArduPlane) is not judged; that of a fixed wing with "
        "{key:turn_radius_m} is"
    ),
    "landing_ground_unknown": "the ground at the landing place is unknown; give terrain that knows it",
    "lands_fast": (
        "it lands {above_m:height.0} above home, and PX4 without a range finder slows down by its height over home: it "
        "may touch down at up to MPC_Z_VEL_MAX_DN ({speed_m_s:speed}, the default)"
    ),
    "return_altitude_not_given": (
        "the return home is not judged: its altitude is the vehicle's own (give {key:rtl_rel_home_m})"
    ),
    "return_start_unknown": "the return home is not judged: its start is unknown",
    "landing_without_place": "a landing of a fixed wing without a place is not judged; give it one",
    "glide_to_unknown_ground": (
        "the glide leads to the item's altitude, and the ground there is unknown: it is not judged"
    ),
    "glide_off_ground": (
        "the glide leads to the item's altitude, and the ground there lies {off_m:height.1} {below:below|above} it: it "
        "is not judged"
    ),
    "glide_straight": (
        "the landing is judged as a straight glide from the way point before it, and as ArduPlane's defaults "
        "(LAND_FLARE_SEC, LAND_FLARE_ALT) flare it"
    ),
    "lands_downhill": (
        "it lands downhill: {away_m:distance.0} before its place the ground is {higher_m:height.0} higher "
        "({slope_percent:.0f} %): within the altitude error it touches down up to {early_m:distance.0} before its "
        "place, and elsewhere with a wind along the runway: land on a heading of {uphill_deg:.0f}°, uphill, or give "
        "another goal"
    ),
    # -- why what is flown for a command is not known ----------------------------------------------------------------
    "arc_unknown": (
        "{name}: an arc is known only for ArduCopter, up to 359°, without terrain frame, with an item after it that is "
        "no spline, and not from a circle"
    ),
    "spline_unknown": (
        "{name}: a spline is known only for ArduCopter, without terrain frame and with an item after it"
    ),
    "changes_to_forward_flight": (
        "{name}: it changes to forward flight after its climb, in a direction that is not known"
    ),
    "take_off_unknown": "{name}: it comes in the air, or its altitude cannot be told",
    "way_point_unknown": (
        "waypoint: the ground there, or under the leg to it, is not known, or its altitude cannot be told"
    ),
    "waits_for_altitude": "{name}: it waits for an altitude that a balloon may bring",
    "flown_by_computer": "{name}: another computer flies from there on",
    "descends_until_ground": "{name}: it descends until it feels the ground",
    "moves_home": "{name}: it moves home, from which altitudes and the return count",
    "releases_parachute": "{name}: it releases the parachute",
    "switches_mode": "{name}: a switch may change the flight mode",
    "controls_engine": "{name}: it starts or stops the engine",
    "sets_parameter": "{name}: it may change any parameter",
    "breaks_off_landing": "{name}: it breaks a landing off",
    "motion_unknown": "{name}: its motion is not known",
    "command_unknown": "its motion is not known",
}
