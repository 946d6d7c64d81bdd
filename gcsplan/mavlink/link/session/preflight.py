"""Preflight: whether a list may be sent to a vehicle in its present state, with all reasons against it in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gcsplan.errors import VehicleRefused
from gcsplan.mavlink.link.watch import (
    CAN_FENCE,
    CAN_MISSION_INT,
    CAN_RALLY,
    CAN_TERRAIN,
    CRITICAL,
    EMERGENCY,
    POWEROFF,
    STANDBY,
    STATE_WORDS,
    UNINIT,
    VehicleState,
)
from gcsplan.mavlink.mission.autopilots import (
    STRAIGHT_UNTIL,
    flies_straight,
    is_generic,
    max_items,
    needs_straight,
    profile_of,
    type_name,
    version_words,
)
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, RELATIVE, TERRAIN, Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

NEAR_START_M = 30.0
NEAR_GROUND_M = 15.0
_EARTH_RADIUS_M = 6_371_008.8

Reasons = list[tuple[str, str]]


def preflight(
    state: VehicleState,
    items: Sequence[MissionItem],
    autopilot: Autopilot,
    *,
    mission_type: int = MISSION,
    start: Home | None = None,
    ground_amsl_m: float | None = None,
    allow_armed: bool = False,
    ignore_position: bool = False,
    judged: bool = False,
) -> list[Note]:
    """Return the warnings about sending ``items`` (wire order) to a vehicle in ``state``.

    ``start``: where the mission begins. ``ground_amsl_m``: the ground altitude there, by default that of ``start``.
    ``judged``: the list is a mission that was judged, with straight legs.
    Raises VehicleRefused with every reason against it; its ``reason`` is the first one's word.
    """
    against, warnings = objections(
        state, items, autopilot, mission_type=mission_type, start=start, ground_amsl_m=ground_amsl_m,
        allow_armed=allow_armed, ignore_position=ignore_position, judged=judged,
    )  # fmt: skip
    if against:
        words = "; ".join(text for _, text in against)
        raise VehicleRefused(f"not sent: {words}", where=f"vehicle {state.address.sysid}", reason=against[0][0])
    return warnings


def objections(
    state: VehicleState,
    items: Sequence[MissionItem],
    autopilot: Autopilot,
    *,
    mission_type: int = MISSION,
    start: Home | None = None,
    ground_amsl_m: float | None = None,
    allow_armed: bool = False,
    ignore_position: bool = False,
    judged: bool = False,
) -> tuple[Reasons, list[Note]]:
    """Return the reasons against sending, each a word and a text, and the warnings; arguments as in `preflight`."""
    against: list[tuple[str, str]] = []
    warnings: list[Note] = []
    identity(state, autopilot, against, warnings, judged=judged)
    _readiness(state, allow_armed, against, warnings)
    _abilities(state, items, autopilot, mission_type, against, warnings)
    if mission_type == MISSION and needs_straight(items, autopilot) and not is_generic(state.mav_autopilot):
        _straightness(state, against, warnings, judged=judged)
    if start is not None and not ignore_position:
        ground = start.amsl_m if ground_amsl_m is None else ground_amsl_m
        _position(state, start, ground, against, warnings)
    return against, warnings


def identity(
    state: VehicleState, autopilot: Autopilot, against: Reasons, warnings: list[Note], *, judged: bool
) -> None:
    """Add to ``against`` and ``warnings`` what speaks against its being the one vehicle with that autopilot.

    ``judged``: it must fly as a mission for this autopilot is judged, which a PX4's wings do not.
    """
    if state.sources > 1:
        against.append(("ambiguous", rivals_words(state)))
    row = profile_of(autopilot)
    if is_generic(state.mav_autopilot):
        warnings.append(Note("autopilot_not_checked", what=state.what, autopilot=row.label))
        return
    if state.mav_autopilot != row.mav_autopilot:
        against.append(
            (
                "wrong_autopilot",
                f"the mission is written for {row.label}, and the vehicle is {state.what}: plan it for that autopilot",
            )
        )
    elif state.mav_type not in (row.judged_types if judged else row.mav_types):
        if state.mav_type == 0:
            warnings.append(Note("vehicle_type_not_told", autopilot=row.label))
        else:
            against.append(
                (
                    "wrong_autopilot",
                    f"the vehicle is a {type_name(state.mav_type)}, which does not fly as a mission for {row.label} is "
                    f"judged",
                )
            )


def rivals_words(state: VehicleState) -> str:
    """Return the message that several vehicles have the same system id, and what to do about it."""
    return (
        f"{state.sources} autopilots speak as system {state.address.sysid}: give each vehicle its own number, or leave "
        f"one of them off the link"
    )


def _readiness(state: VehicleState, allow_armed: bool, against: Reasons, warnings: list[Note]) -> None:
    status = state.system_status
    words = STATE_WORDS.get(status, f"in state {status}")
    if status == UNINIT and is_generic(state.mav_autopilot):
        warnings.append(Note("vehicle_state_not_told"))
    elif status < STANDBY:
        against.append(("not_ready", f"the vehicle is {words}: wait until it reports standby"))
    elif status in (CRITICAL, EMERGENCY):
        warnings.append(Note("vehicle_in_trouble", state=words))
    elif status >= POWEROFF:
        against.append(("not_ready", f"the vehicle is {words}"))
    if state.armed:
        if allow_armed:
            warnings.append(Note("armed_as_allowed"))
        else:
            against.append(("armed", "the vehicle is armed: disarm it, or allow it with --allow-armed"))


def _abilities(
    state: VehicleState,
    items: Sequence[MissionItem],
    autopilot: Autopilot,
    mission_type: int,
    against: Reasons,
    warnings: list[Note],
) -> None:
    most = max_items(autopilot, mission_type)
    if len(items) > most:
        against.append(("too_many_items", f"it takes at most {most} items and the list has {len(items)}"))
    needed = {FENCE: (CAN_FENCE, "fence"), RALLY: (CAN_RALLY, "rally points")}.get(mission_type)
    if needed and state.can(needed[0]) is False:
        against.append(("unsupported", f"the vehicle says that it keeps no {needed[1]}"))
    if needed and state.mavlink1:
        against.append(("mavlink1", f"{Note('only_mavlink1')}: no {needed[1]} can be sent"))
    elif state.mavlink1:
        warnings.append(Note("only_mavlink1"))
    if state.capabilities is None:
        warnings.append(Note("capabilities_not_told"))
    elif not state.can(CAN_MISSION_INT) and not is_generic(state.mav_autopilot):
        warnings.append(Note("item_int_not_told"))
    if any(item.frame in (TERRAIN, 11) for item in items) and state.can(CAN_TERRAIN) is False:
        warnings.append(Note("terrain_ability_not_told"))


def _straightness(state: VehicleState, against: Reasons, warnings: list[Note], *, judged: bool) -> None:
    if flies_straight(state.flight_sw_version):
        return
    last = ".".join(map(str, STRAIGHT_UNTIL))
    found = Note("px4_may_miss_way_points", version=version_words(state.flight_sw_version))
    if judged:
        against.append(
            (
                "firmware",
                f"{found}: the straight legs that were judged hold until PX4 {last} alone; fly that, or at one "
                f"altitude",
            )
        )
    else:
        warnings.append(found)


def _position(state: VehicleState, start: Home, ground_m: float, against: Reasons, warnings: list[Note]) -> None:
    if state.lat_deg is None or state.lon_deg is None or state.amsl_m is None:
        found = Note("position_not_told")
        if is_generic(state.mav_autopilot):
            warnings.append(found)
        else:
            against.append(("no_position", f"{found}: wait until it has a position, or --ignore-position"))
        return
    away_m = distance_m(state.lat_deg, state.lon_deg, start.lat_e7 / 1e7, start.lon_e7 / 1e7)
    if state.just_at is not None and away_m <= NEAR_START_M:
        lat, lon, _ = state.just_at
        words = f"the vehicle reports two places by turns, the other at {lat:.6f}, {lon:.6f}: are there two of it?"
        against.append(("wrong_place", words))
    if away_m > NEAR_START_M:
        against.append(
            (
                "wrong_place",
                f"the vehicle stands {away_m:.0f} m from the mission's start (at {state.lat_deg:.6f}, "
                f"{state.lon_deg:.6f}; {NEAR_START_M:.0f} m is allowed): move it, plan from there, or "
                "--ignore-position",
            )
        )
    off_m = state.amsl_m - ground_m
    if abs(off_m) > NEAR_GROUND_M:
        against.append(
            (
                "wrong_height",
                f"the vehicle reports {state.amsl_m:.1f} m AMSL where the ground is at {ground_m:.1f} m "
                f"({off_m:+.1f} m; {NEAR_GROUND_M:.0f} m is allowed): wait for a better fix, check the DEM's datum, or "
                "--ignore-position",
            )
        )


def apart_m(a: VehicleState, b: VehicleState) -> float | None:
    """Return the metres between two vehicles' positions; None if one of them is unknown."""
    if a.lat_deg is None or a.lon_deg is None or b.lat_deg is None or b.lon_deg is None:
        return None
    return distance_m(a.lat_deg, a.lon_deg, b.lat_deg, b.lon_deg)


def distance_m(lat_a: float, lon_a: float, lat_b: float, lon_b: float) -> float:
    """Return the great-circle distance in metres between two places in degrees (haversine on the mean sphere)."""
    a, b = math.radians(lat_a), math.radians(lat_b)
    h = math.sin((b - a) / 2) ** 2 + math.cos(a) * math.cos(b) * math.sin(math.radians(lon_b - lon_a) / 2) ** 2
    return 2 * _EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(h)))


def other_home(mission: Mission, read: tuple[MissionItem, ...]) -> list[Note]:
    """Warn if ArduPilot's item 0 is away from the mission's start: relative altitudes count from it until arming."""
    if not mission.autopilot.is_ardupilot or (read[0].x, read[0].y) == (0, 0):
        return []
    theirs, ours = Home(read[0].x, read[0].y, read[0].z), mission.home
    away_m = distance_m(ours.lat_e7 / 1e7, ours.lon_e7 / 1e7, theirs.lat_e7 / 1e7, theirs.lon_e7 / 1e7)
    higher_m = theirs.amsl_m - ours.amsl_m
    if away_m <= NEAR_START_M and abs(higher_m) <= NEAR_GROUND_M:
        return []
    relative = any(item.frame in (RELATIVE, 6) for item in mission.items)
    return [
        Note(
            "home_on_board_elsewhere_counts" if relative else "home_on_board_elsewhere", away_m=away_m,
            higher_m=higher_m, off_m=abs(higher_m), above=higher_m >= 0.0,
        )
    ]  # fmt: skip
