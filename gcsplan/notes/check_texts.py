"""Sentences on what the check finds, does not judge and notes: items, turns, findings, energy."""

CHECK_TEXTS = {
    # -- the difference to an earlier mission of the same vehicle --
    "difference_none": "nothing changed since {since}: the missions are equal, item for item",
    "difference_of_items": "no leg moved since {since}; items differ",
    "difference_of_path": "{moved} of {legs} {legs:leg|legs} moved since {since}, by {most_m:distance.0 up} at most",
    "difference_not_measured": "how far the legs moved since {since} is not measured",
    "moved_leg": "{by_m:distance.0 up}",
    "more_moved_legs": "{count} more",
    "difference_moved_legs": "moved farthest: {legs}",
    "difference_new_note": "new: {note}",
    "difference_gone_note": "no longer: {note}",
    "difference_earlier_breaks": "{since} would break a limit now, or is not judged: {note}",
    "last_plan_unread": "the last plan cannot be compared: {why}",
    # -- what an autopilot does with a mission's items, and on what of it is not judged --
    # -- home --------------------------------------------------------------------------------------------------------
    "home_ground_unknown": (
        "the ground at home ({lat:.7f}, {lon:.7f}) is unknown: give terrain that knows it, or another home"
    ),
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
    "takes_off_elsewhere": (
        "take-off lies {away_m:distance.0} from home: what PX4 does between is not judged; give it the place of home"
    ),
    "takes_off_where_it_stands": (
        "take-off is written {away_m:distance.0} from home; ArduCopter takes off where it stands"
    ),
    "vtol_in_wind": (
        "an ArduPlane without {key:turn_radius_m} is taken for a VTOL, which takes off and lands vertically: its "
        "flight in winds is not judged; give a fixed wing that key"
    ),
    "arcs_without_radius": (
        "an ArduPlane flies its way points on its wing and swings wide of its corners: they are judged with a "
        "{key:turn_radius_m} alone"
    ),
    "vtol_sets_off": (
        "a VTOL's take-off is judged as vertical, and the flight as on its wing from there on (Q_ENABLE 1): stand it "
        "with its nose at {heading_deg:.0f}°, for it sets off where its nose points"
    ),
    "vtol_overshoots": (
        "it brakes for its landing over {brakes_m:distance.0 up} (Q_TRANS_DECEL 2), and its way there is shorter: "
        "{past_m:distance.0 up} around the place are judged; a way point farther from it takes that away"
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
    "climb_out_blown": (
        "winds and gusts of up to {wind_m_s:speed.1} are judged in its climb-out: less steep over ground with one "
        "behind, and up to {drift_m:distance.0 up} aside, as its nose holds the heading"
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
    "circle_too_banked": (
        "a circle of {radius_m:distance} at {speed_m_s:speed} needs a bank of {bank_deg:.0f}°, and ArduPlane's "
        "ROLL_LIMIT_DEG is {most_deg:g}°: the circle that it flies is wider, and not judged; give a larger radius, or "
        "a lower speed"
    ),
    "climb_rate_uncounted": "a rate of climb or descent for PX4 is not counted in the time",
    "gate_missed": (
        "it may come to its gate {by_s:seconds.1} too late for the gate's second, and would wait there until the next "
        "day"
    ),
    "gates_since_departure": ("its gates are judged for leaving the ground at {leaves} UTC"),
    "gate_departure_unknown": (
        "its first gate opens at {opens} UTC: it must leave the ground by {leaves} UTC, for which all else is judged; "
        "`at` (or --at) says when a vehicle leaves that flies alone"
    ),
    "waits_until_time": ("the energy of a wait until a time of day is not known; give its seconds (param1)"),
    "hold_without_known_end": (
        "a hold of {hold_s} s (param1) has no end that is known (give its seconds): that is not judged"
    ),
    "reads_terrain_on_board": (
        "terrain-frame legs depend on the terrain data in the vehicle; judged as it reads this terrain, at posts every "
        "{spacing_m:distance}, with {error_m:height} of error"
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
        "a runway landing's glide (NAV_LAND on ArduPlane) is not judged; the glide of a fixed wing with "
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
    "return_start_unknown": "the return home is not judged: its start is unknown; it is once the items before it are",
    "landing_without_place": "a landing of a fixed wing without a place is not judged; give it one",
    "glide_to_unknown_ground": (
        "the glide leads to the item's altitude, and the ground there is unknown: it is not judged; give terrain "
        "that knows it"
    ),
    "glide_off_ground": (
        "the glide leads to the item's altitude, and the ground there lies {off_m:height.1} {below:below|above} it: it "
        "is not judged; give the item the height of the ground"
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
    # -- why the flight for a command is not known -------------------------------------------------------------------
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
    "take_off_unknown": "{name}: it comes in the air, or its altitude is not known",
    "way_point_unknown": (
        "waypoint: the ground there, or under the leg to it, is not known, or its altitude is not known"
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
    # -- corners and turns: where a vehicle begins them, and which parts of them are not judged --
    "arcs_unread": (
        "the arcs of {radius_m:distance} that {vehicle} flies at its corners are not judged: {autopilot} begins a turn "
        "by parameters that the mission does not hold; the arcs of ArduPlane are judged"
    ),
    "arcs_too_banked": (
        "turns of {radius_m:distance} at {speed_m_s:speed} need a bank of {bank_deg:.0f}°, and ArduPlane's "
        "ROLL_LIMIT_DEG is {most_deg:g}°: the arcs that it flies are wider, and not judged; give a larger "
        "{key:turn_radius_m}, or a lower speed"
    ),
    "l1_period_out_of_range": (
        "NAVL1_PERIOD is {period_s:g} s, and ArduPlane takes {least_s:g} to {most_s:g} s: the arcs that it flies at "
        "its corners are not judged; set NAVL1_PERIOD within that"
    ),
    "turns_late": (
        "flies {past_m:distance.0} past its way point before it turns (param3): that is not judged; set param3 to 0"
    ),
    "corner_in_terrain_frame": (
        "what a fixed wing flies at a corner in the terrain frame is not judged; give altitudes above home (frame 3)"
    ),
    "corner_turns_back": (
        "what a fixed wing flies at a corner that turns by {turn_deg:.0f}° is not judged; put a way point beside it, "
        "so that it turns in two"
    ),
    "arcs_too_long": (
        "arcs of {radius_m:distance} take {arcs_m:distance.0} of the leg to item {leg}, which is {leg_m:distance.0} "
        "long: the flight there is not judged; make the leg longer, or give a smaller {key:turn_radius_m}"
    ),
    "turn_too_early": (
        "the turn begins {begins_m:distance.0} before the end of the leg to item {leg}, which is {leg_m:distance.0} "
        "long: the flight there is not judged; make the leg longer, or give a smaller acceptance radius (param2)"
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
    "arc_begun_by_default": (
        "it gives no acceptance radius: its turn is judged as begun by WP_RADIUS {radius_m:distance}, "
        "{radius_read:read from the vehicle|the default}, and NAVL1_PERIOD {period_s:g} s, {period_read:read from the "
        "vehicle|the default}"
    ),
    # -- limits that a mission breaks, and on how near it comes to those that it keeps --
    "after_jump": "{way}, after the jump at item {jump}",
    # -- limits ------------------------------------------------------------------------------------------------------
    "too_low": (
        "too low above ground: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "too_high": (
        "too high above ground: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "above_ceiling": (
        "above {key:max_amsl_m}: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "near_rising_ground": (
        "too near to rising ground at flight level: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) "
        "at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "outside_keep_in": (
        "leaves keep-in area “{zone}”, or comes too near to its edge (by {by_m:distance.2}), at {lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.1}"
    ),
    "inside_zone": (
        "inside no-fly zone “{zone}” or its clearance (by {by_m:distance.2}) at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "inside_fence_area": (
        "inside the fence's area “{zone}” or its clearance (by {by_m:distance.2}) at {lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.1}"
    ),
    "rally_point_not_clear": "rally point {number}, where a return would land: {why}",
    "rally_point_too_low": (
        "rally point {number} is flown over at {level_m:amsl.1 down}, and the ground there reaches "
        "{ground_m:amsl.1 up}: raise the point or the return altitude (by {by_m:height.1 up})"
    ),
    "outside_fence_area": "leaves the fence's area “{zone}” (by {by_m:distance.1})",
    "far_outside_fence_area": "leaves the fence's area “{zone}”, which is far away",
    "climbs_too_steeply": (
        "climbs too steeply: {value_deg:.2f} deg, limit {limit_deg:.2f} deg (by {by_deg:.2f} deg) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "descends_too_steeply": (
        "descends too steeply: {value_deg:.2f} deg, limit {limit_deg:.2f} deg (by {by_deg:.2f} deg) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "glides_too_steeply": "glides down too steeply: {value_deg:.2f}°, limit {limit_deg:g}°",
    "near_ground_on_slant": (
        "the {glide:glide|climb-out} comes too near to the ground, by {by_m:height.2}, at {lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.1}{obstacles}"
    ),
    "obstacles_beside_strip": (
        "; from twice {key:altitude_error_m} above the strip on trees and buildings count too, and "
        "{key:obstacle_height_m} puts them everywhere: above {key:altitude_error_m} no way over level ground clears "
        "them. Where the way is open, give `canopy`, a raster with 0 there, in place of {key:obstacle_height_m}"
    ),
    # -- terrain, battery, autopilot ---------------------------------------------------------------------------------
    "over_unknown_ground": (
        "over ground that the terrain model does not know at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "over_ground_unread": (
        "over ground that the vehicle's terrain grid does not know, on the way to {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "too_far_away": ("goes to {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}: too far from the mission's terrain to be judged"),
    "battery_not_enough": (
        "battery: the flight needs {needs_j:joules}{windy: in the worst declared wind|} and {usable_j:joules} may be "
        "used ({battery_j:joules} less {reserve_percent:g} % reserve)"
    ),
    "battery_that_would_do": "{key_name}: {enough}{lasts} would do for this path",
    "battery_lasts": " with {key_name}: {lasting_min:g} (the same power)",
    "too_many_items": "the mission has {count} items and {autopilot} takes {most}",
    "refused_on_upload": "would be refused on upload: {why}",
    "item_unreached": "item {by} {jumps:jumps back|holds} without end: item {item} is never reached",
    "items_unreached": "item {by} {jumps:jumps back|holds} without end: items {item} to {last} are never reached",
    # -- how near a mission comes to a limit: heights are not those of the table of legs, which has the path as it is --
    #    planned, so the words say which way they go
    "lowest_above_ground": (
        "lowest above ground, less the errors: {value_m:height.1 down} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "highest_above_ground": (
        "highest above ground, with the errors: {value_m:height.1 up} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "highest_altitude": (
        "highest altitude, with the errors: {value_m:height.1 up} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "lowest_within_clearance": (
        "lowest above ground within the clearance, less the errors: {value_m:height.1 down} of {limit_m:height bare}, "
        "{left}, item {seq} ({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "steepest_climb": (
        "steepest climb: {value_deg:angle.1 up} of {limit_deg:g}, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "steepest_descent": (
        "steepest descent: {value_deg:angle.1 up} of {limit_deg:g}, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "nearest_zone": (
        "nearest to zone {zone}: {value_m:distance.1 down} of {limit_m:distance bare}, {left}, item {seq} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.0})"
    ),
    "nearest_inside_zone": (
        "inside zone {zone}: {value_m:distance.1 up} from its edge, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "spare_height": "{room_m:height.1 down} to spare",
    "spare_distance": "{room_m:distance.1 down} to spare beyond the track error",
    "spare_angle": "{room_deg:angle.1 down} to spare",
    "broken_height": "broken by {room_m:height.1 up}",
    "broken_distance": "broken by {room_m:distance.1 up} with the track error",
    "broken_angle": "broken by {room_deg:angle.1 up}",
    # -- in a rehearsal ----------------------------------------------------------------------------------------------
    "flew_too_low": (
        "{name} came too low above ground by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_too_high": (
        "{name} came too high above ground by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_above_ceiling": (
        "{name} came above {key:max_amsl_m} by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_near_rising_ground": (
        "{name} came too near to rising ground at its level by {by_m:height.2} at {time_s:seconds.1}, item {item} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_out_of_keep_in": (
        "{name} left keep-in area “{zone}”, or came too near to its edge, by {by_m:distance.2} at {time_s:seconds.1}, "
        "item {item} ({lat:.6f}, {lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_into_zone": (
        "{name} came into no-fly zone “{zone}” or its clearance by {by_m:distance.2} at {time_s:seconds.1}, item "
        "{item} ({lat:.6f}, {lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_over_unknown_ground": (
        "{name} came over ground that the terrain model does not know at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    # -- energy and battery --
    "paper_energy": (
        "energy and battery count the paper's 120 J for a metre up or down and 100 J for one along, which say nothing "
        "about this aircraft: give what flying takes under energy: (cruise_w, endurance_min, or what fit-energy finds)"
    ),
    "energy_fitted_elsewhere": (
        "the energy is fitted to flights at {fitted:speed}, and from item {item} on it flies at {speed_m_s:speed.1}: "
        "what it needs may be far off; fit the energy to flights at that speed, too"
    ),
    "battery_lasts_unknown": "how long the battery lasts there is not known, for hover_w is 0",
    "battery_until_reserve": (
        "{loop:its round|its hold} has no end: the battery comes to its reserve after {left_s:.0f} s of it"
    ),
}
