"""Sentences on a fleet: departures, holds and speeds of its vehicles, and the distance between them."""

TEXTS = {
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
    "clock_of_fleet": (
        "{first}, the first, arrives at {arrive_s:seconds.1} instead of {alone_s:seconds.1}, so that the others can "
        "follow {interval_s:g} s apart (clock: fleet)"
    ),
}
