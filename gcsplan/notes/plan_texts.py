"""Sentences on plans, fleets and rehearsals."""

PLAN_TEXTS = {
    # -- a plan: its bound, its search, and what of the request had to be changed --
    # -- the bound and the search
    "bound_of_farther_paths": (
        "the terrain was looked at within {within_m:far.1} of the straight track: the lower bound is that of paths "
        "which go farther"
    ),
    "bound_ignores_turns": ("the lower bound is that of paths with sharp corners: it ignores {key:turn_radius_m}"),
    "bound_by_cells": "the lower bound knows the room between min and max AGL only cell by cell of the terrain",
    "bound_with_climb_out": ("the lower bound is that of missions with this climb-out{approach: and this approach|}"),
    "planned_again": (
        "planned {times} times, each time with larger margins: the first mission breaks a limit as it is flown"
    ),
    "searches_failed": ("{searches} {searches:search|searches} of {optimiser} ended without a path before this one"),
    "curve_pushed": (
        "the curve that {optimiser} found breaks {broken}; it was pushed sideways by up to {pushed_m:distance.0} and "
        "given new altitudes, and it passes the check"
    ),
    "curve_lifted": (
        "the curve that {optimiser} found breaks {broken}; it was given new altitudes, and it passes the check"
    ),
    "curve_thinned": "the curve that {optimiser} found breaks {broken}; its way points pass",
    "limits_broken": "limits on {legs} of its legs ({limits})",
    "limit_by_length": "{limit} by {by_m:height.1}",
    "limit_by_angle": "{limit} by {by_deg:.1f} °",
    "zone_by": "zone '{zone}' by {by_m:distance.1}",
    "more_limits": "{count} more",
    "only_way_points_break": "no limit, but its way points do",
    # -- the request
    "takeoff_raised": (
        "{key:takeoff_agl_m} {asked_m:height} raised to {raised_m:height.2}: so far the ground rises within the track "
        "error"
    ),
    "approach_raised": (
        "{key:approach_agl_m} {asked_m:height} raised to {raised_m:height.2}: so far the ground rises within the track "
        "error"
    ),
    "via_moved": "via point {via} is moved {aside_m:distance} aside: the climb there is on the spot",
    "flown_as_quadplane": (
        "it is flown as a VTOL (QuadPlane, Q_ENABLE 1): vertical take-off and landing, and in between on its wing, "
        "with turns of {radius_m:distance} ({key:turn_radius_m})"
    ),
    "climb_out": (
        "launch it on a heading of {heading_deg:.0f}°: it climbs straight ahead for {far_m:distance.0} to "
        "{up_m:height.0} above home"
    ),
    "climb_out_in_circles": (
        "launch it on a heading of {heading_deg:.0f}°: it climbs straight ahead for {far_m:distance.0} to "
        "{up_m:height.0} above home, and goes on in circles of {circle_m:distance.0} up to {circled_m:height.0}"
    ),
    "circles_instead": (
        "that is a long way straight ahead: with climb_out: circles it turns after {far_m:distance.0} and climbs in "
        "circles of {circle_m:distance.0} to {up_m:height.0} above home; this was tried: the mission is safe, and "
        "{length_m:path.0} long"
    ),
    "approach": (
        "it lands on a heading of {heading_deg:.0f}°, gliding straight for {far_m:distance.0} from {up_m:height.0} "
        "above the goal"
    ),
    "approach_into_wind": (
        "it lands into the declared winds{uphill: and uphill|}: they blow least from behind on headings like this one"
    ),
    "approach_uphill": "it lands uphill, so that it does not meet the ground before its place",
    "paper_energy_minimised": "the energy that is minimised is the paper's: a vehicle has no `energy:`",
    # -- a fleet: departures, holds and speeds of its vehicles, and the distance between them --
    # -- one vehicle's part
    "waits_on_ground": "waits {wait_s:.1f} s on the ground",
    "holds_at_gate": "holds {hold_s:.0f} s at the gate ({energy_j:.0f} J)",
    "holds_and_waits": (
        "holds {hold_s:.0f} s at the gate ({energy_j:.0f} J); a hold is whole seconds: the rest, {wait_s:.2f} s, it "
        "waits on the ground"
    ),
    "flies_longer": "flies {more_m:distance.0} more, to arrive so late",
    "keeps_clear": "{changes}: to keep clear of {other} ({time_s:seconds.1}, {amsl_m:amsl.0})",
    "leaves_later": "leaves {by_s:.1f} s later",
    "leaves_earlier": "leaves {by_s:.1f} s earlier",
    "flies_at": "flies at {speed_m_s:speed.2 bare} instead of {was_m_s:speed.2}",
    "holds_longer": "holds {by_s:g} s at the gate",
    "takes_another_path": "takes another path",
    "needs_more_energy": "needs {more_j:+.0f} J",
    "first_waits_for": (
        "the first arrives at {arrive_s:seconds.1} instead of {alone_s:seconds.1}, so that {last}, which needs "
        "{needs_s:seconds.1} at its fastest, can follow"
    ),
    "lean_beyond_largest": (
        "{speed_m_s:speed.2} needs a lean of more than {largest_deg:g}°, which is ArduCopter's largest: a vehicle that "
        "flies this mission arrives late"
    ),
    "lean_to_set": "{speed_m_s:speed.2} needs a lean of about {lean_deg:g}°: set {parameter} before it flies",
    "tilt_parameter": "MPC_TILTMAX_AIR {lean_deg:g}",
    "lean_parameter": (
        "ATC_ANGLE_MAX {lean_deg:g} (degrees, since ArduPilot 4.7) or ANGLE_MAX {lean_cdeg:g} (hundredths of a degree, "
        "before)"
    ),
    "lean_counted_with": (
        "times, and forecasts in wind, count with {key:lean_angle_deg}: {lean_deg:g}: they hold with {parameter}"
    ),
    # -- the whole fleet
    "starts_within_separation": (
        "{pairs} {pairs:pair|pairs} of start places {pairs:is|are} nearer than {needed_m:distance} (nearest: {first}, "
        "{second}: {apart_m:distance.1}): vehicles that wait on the ground are not judged against each other"
    ),
    "departs_late": (
        "it may depart up to {late_s:.0f} s late: its windows of arrival count that, and so do the order, the "
        "intervals and the separation of a fleet"
    ),
    "judged_in_wind": (
        "the aircraft can fly the mission in all declared winds; windows of times stand beside the times in still air, "
        "energies are those of the worst wind, and a multicopter's corners are judged as in still air"
    ),
    "wind_too_strong": (
        "the aircraft cannot keep its track in a wind of {wind_m_s:speed.1} from {from_deg:.0f}°{gusts}; it can fly "
        "the mission if the declared winds, gusts included, reach {up_to_m_s:speed.1 down} at most"
    ),
    "schedule_in_every_wind": (
        "no declared wind changes the time of a leg, so the time table, its order and its separation hold in each"
    ),
    "schedule_kept_in_winds": (
        "the time table holds in every declared wind, one and the same for all vehicles unless it varies: the order, "
        "intervals within {off_s:seconds.1 up}, and the separation"
    ),
    "speed_kept_in_wind": (
        "it flies at {speed_m_s:speed.2} at most, which it keeps over ground in every declared wind"
    ),
    "schedule_in_still_air": (
        "the time table holds in still air alone: in the declared winds nothing keeps the vehicles apart or in their "
        "order; {overlapping} {overlapping:pair|pairs} of neighbouring arrivals may change places, with windows that "
        "overlap by up to {most_s:seconds.1}"
    ),
    "no_arrival_asked": "the file asks for no `arrival`: the separation between vehicles is not judged",
    "nothing_keeps_apart": (
        "the file asks for no `arrival`, so nothing keeps the vehicles apart; released together, {met}"
    ),
    "too_near": "the vehicles come too near to each other:{conflicts:lines}",
    "more_conflicts": "and {count} more",
    "come_near": (
        "{first} and {second} come as near as {distance_m:distance.1 down}, needed {needed_m:distance}, at "
        "{time_s:seconds.1} ({place})"
    ),
    "takes_off_beside": (
        "{first} takes off from a place {distance_m:distance.1 down}, needed {needed_m:distance} from where {second} "
        "stands, at {time_s:seconds.1} ({place})"
    ),
    "lands_beside": (
        "{first} lands at a place {distance_m:distance.1 down}, needed {needed_m:distance} from where {second} stands, "
        "at {time_s:seconds.1} ({place})"
    ),
    "place_in_plane": "east {east_m:distance.0}, north {north_m:distance.0}, {amsl_m:height.0} above sea level",
    "place_on_map": "{lat_deg:.6f}, {lon_deg:.6f}, {amsl_m:amsl.0}",
    "gates_open": (
        "the gates open from T+0 = {start_utc} UTC on: a vehicle that comes to its gate after its second waits there "
        "for nearly a day; release each by its time, {spare_s:g} s are to spare"
    ),
    "gates_on_way_open": (
        "the gates on the way open from T+0 = {start_utc} UTC on: each vehicle is there early in every declared wind; "
        "one that comes after its gate's second waits there for nearly a day"
    ),
    "no_gates_on_way": (
        "has no gates: {autopilot} {px4:reads only the seconds of a wait|does not wait in the air}, so it goes on "
        "at once at a gate with a time of day"
    ),
    "waits_at_gates": (
        "waits {wait_s:seconds.0} in all at {count} {count:gate|gates} on its way{energy}; its arrivals in the "
        "declared winds lie within {width_s:seconds.1} instead of {without_s:seconds.1}"
    ),
    "gates_take": (", for {energy_j:joules} at most"),
    "clock_of_fleet": (
        "{first}, the first, arrives at {arrive_s:seconds.1} instead of {alone_s:seconds.1}, so that the others can "
        "follow {interval_s:g} s apart (clock: fleet)"
    ),
    # -- a rehearsal: what was not kept, what was not flown, and how it was flown --
    # -- what was not kept
    "never_arrived": "{name} never arrived at its goal",
    "never_arrived_for": "{name} never arrived at its goal: {why}",
    "hit_ground": "it hit the ground at {speed_m_s:speed.1} on its way to item {item}",
    "left_auto": "it left AUTO for {mode} at item {item}",
    "time_was_up": "it still flew to item {item} when the time was up",
    "other_ground": (
        "that is {height_m:height.0} above the mission's ground: without terrain an SITL's ground is flat at the "
        "altitude of home, and --sitl-binary starts one with the mission's terrain"
    ),
    "vehicle_said": "it sent: {texts}",
    "arrived_late": "{name} arrived {late_s:seconds} late, after {took_s:seconds} instead of {told_s:seconds}",
    "down_late": "{name} was down {late_s:seconds} late, after {took_s:seconds} instead of {told_s:seconds}",
    "arrived_outside_window": (
        "{name} arrived {off_s:seconds.1} {late:after|before} its window, which is {earliest_s:seconds.1} to "
        "{latest_s:seconds.1} after its departure"
    ),
    "battery_used_up": (
        "{name} used {used_percent:.0f} % of its battery{paper: (paper's figures)|}, of which {reserve_percent:g} % "
        "must stay"
    ),
    "order_lost": "the order of arrival was {came}; planned was {planned}",
    "came_too_near": (
        "{first} and {second} came as near as {distance_m:distance.1 down}, needed are {needed_m:distance}, at "
        "{time_s:seconds.1}"
    ),
    "landed_too_near": (
        "{first} landed beside {second}, which stood there: {distance_m:distance.1 down}, needed are "
        "{needed_m:distance}, at {time_s:seconds.1}"
    ),
    "in_some_runs": "{what} (in {runs} of {of_runs} runs)",
    # -- what was not flown
    "circle_not_flown": "its circle is not flown, the simulated vehicle waits at the middle",
    "jump_flown_once": "a jump flies it again and again, the simulated vehicle once",
    "turns_flown_as_corners": "its turns of {radius_m:distance} are flown as corners",
    # -- how it was flown
    "energy_fitted_to_other_air": (
        "its energy is fitted to flights at {slow_m_s:speed bare} to {fast_m_s:speed} through the air, and it flew at "
        "{speed_m_s:speed.0} in this wind: what it used may be far off"
    ),
    "runs_alike": "without wind, gusts and noise every run is the same: one was flown",
    "released_early": ("every vehicle was released {before_s:g} s before its departure, for its motors to spin up"),
    "left_ground_off_time": "{vehicle} left the ground {off_s:+.1f} s from its departure",
}
