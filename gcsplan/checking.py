"""Anybody's `.waypoints` and `.plan` files, each held against the world of a mission file."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, InputError, UsageError
from gcsplan.mavlink.files import read_mission_file
from gcsplan.mavlink.mission import Home, Mission
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.pipeline import world_of
from gcsplan.vehicle import Vehicle

SAME_PLACE_M = 1.0
"""A home row within this of the vehicle's start is the start."""


@dataclass(frozen=True, slots=True)
class Checked:
    """One file, the vehicle that it is for, and the verdict."""

    file: Path
    vehicle: Vehicle
    request: VehicleRequest
    mission: Mission
    verdict: Verdict
    notes: tuple[str, ...]


def split_name(argument: str) -> tuple[str | None, Path]:
    """``uav1=FILE`` or ``FILE``: the vehicle's name if given, and the file."""
    name, equals, file = argument.partition("=")
    if equals and re.fullmatch(r"[A-Za-z0-9_-]+", name) and not os.path.exists(argument):
        return name, Path(file)
    return None, Path(argument)


def match(source: MissionFile, argument: str) -> tuple[VehicleRequest, Path]:
    """The vehicle that a file is for: named, or of the file's stem, or the only one. Raises UsageError if unclear."""
    name, file = split_name(argument)
    by_name = {r.vehicle.name: r for r in source.vehicles}
    if name is not None:
        if name not in by_name:
            raise UsageError(f"{argument}: the mission file has no vehicle {name!r}; it has {', '.join(by_name)}")
        return by_name[name], file
    if file.stem in by_name:
        return by_name[file.stem], file
    if len(by_name) == 1:
        return next(iter(by_name.values())), file
    raise UsageError(f"{argument}: which vehicle is it for? Write NAME={file} with one of {', '.join(by_name)}")


def check_files(source: MissionFile, arguments: Sequence[str]) -> list[Checked]:
    """Judge each FILE or NAME=FILE in the world of ``source``; InputError and UsageError for what is not readable."""
    from gcsplan.mavlink.preflight import distance_m  # with the dialect behind it, which planning can do without

    world = world_of(source)
    checked = []
    for argument in arguments:
        request, file = match(source, argument)
        vehicle = request.vehicle
        start = Home.at(*request.start_deg, request.start[2])
        read = read_mission_file(file, autopilot=vehicle.autopilot, home_hint=start)
        mission = replace(read.mission, name=vehicle.name, sysid=vehicle.sysid)
        notes = list(read.notes)
        if mission.home.lat_e7 == 0 and mission.home.lon_e7 == 0:
            notes.append("the file's home row is blank: the vehicle's start in the mission file was taken for home")
            mission = replace(mission, home=start)
        elif distance_m(mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7, *request.start_deg) > SAME_PLACE_M:
            # No autopilot flies from a file's home row: heights count from where it arms, and that is the start.
            notes.append(
                "the file's home row lies elsewhere: the vehicle's start in the mission file was taken for home"
            )
            mission = replace(mission, home=start)
        if mission.autopilot is not vehicle.autopilot:
            raise InputError(f"is for {mission.autopilot}, and {vehicle.name} is {vehicle.autopilot}", where=str(file))
        verdict = judge(
            mission, vehicle, world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=source.terrain_error_m
        )
        checked.append(Checked(file, vehicle, request, mission, verdict, tuple(notes)))
    return checked


def failure(checked: Sequence[Checked], *, allow_unjudged: bool) -> dict[str, Any] | None:
    """The ``error`` of ``check --json``: which limits are broken or what could not be judged; None if all may fly."""
    bad = [c for c in checked if c.verdict.safe is False or (c.verdict.safe is None and not allow_unjudged)]
    if not bad:
        return None
    broken = any(c.verdict.safe is False for c in bad)
    return {
        "code": CheckFailed.exit_code,
        "reason": "violation" if broken else "not_judged",
        "message": "\n".join(f"{c.vehicle.name}: {line}" for c in bad for line in c.verdict.describe().splitlines()),
        "where": ", ".join(str(c.file) for c in bad),
    }
