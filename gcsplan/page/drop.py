"""`DroppedFile`: the file on the shelf as the page shows it, and its way into the mission when the user takes it.

A file is read as the command line reads it. Nothing is written before `take`, and then only into the mission's folder.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.app.check.files import check_batch, failing_of, home_lines
from gcsplan.app.check.worlds import Checked, Returns, split_name
from gcsplan.check.returns.words import verdict_words
from gcsplan.check.verdict import Verdict
from gcsplan.dem.dat_file import DAT_SUFFIX
from gcsplan.errors import Cancelled, GcsplanError, InputError, Mistake
from gcsplan.mavlink.files.file_items import HAS_PLACE, MissionFileRead
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mavlink.mission.commands import command_name
from gcsplan.mavlink.mission.mission import NO_POSITION, Mission
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.published.times import hours_of, texts_of
from gcsplan.mission_file.published.unused import listed
from gcsplan.mission_file.scene import make_spec
from gcsplan.mission_file.values.errors import read_section
from gcsplan.mission_file.values.schema import TerrainKeys, ZoneKeys
from gcsplan.mission_file.window import opened
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import ZoneDraft, zone_notes
from gcsplan.notes.note import Note, Wording
from gcsplan.page.answers import MOST_ON_PAGE, PROFILE_SAMPLES, flown_line, mistakes_text, profile_of, verdict_word
from gcsplan.page.dropped.route import FileRoute, route_of
from gcsplan.page.dropped.shelf import Dropped, Shelf, ending_of, has_other, laid_out, may_be_zones, place_in
from gcsplan.page.edits import Edits
from gcsplan.page.ground_tiles import bounds_of
from gcsplan.page.places import vehicles_of
from gcsplan.page.refused import PageError
from gcsplan.page.zone_features import DrawnZones
from gcsplan.report.parts.track_samples import TrackLine, line_of
from gcsplan.units import METRIC, Units
from gcsplan.vehicle import Autopilot
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import METRE
from gcsplan.world.terrain.raster import open_raster

MOST_DRAWN = 2000
"""Most zones, and most items, of a dropped file that are drawn."""

ZONE_SETTINGS = ("radius_m", "buffer_m", "layer", "on_bad", "ignore")
GROUND_SETTINGS = ("vertical_datum", "height_unit", "nodata", "crs")
"""Keys of a mission file that the page may give with a file of zones or terrain: none of them names a file."""

GROUND_STAYS = ("obstacle_height_m", "canopy", "canopy_nodata_m")
"""Keys of ``terrain`` that hold for other ground, too."""

ZONE_LISTS = ("no_fly", "keep_in")

FileMessage = Mapping[str, Any]
FileAnswer = dict[str, Any]


class DroppedFile:
    """The file on the ``shelf``, beside the mission of ``edits``; for one thread."""

    def __init__(self, edits: Edits, shelf: Shelf) -> None:
        self._edits, self._shelf = edits, shelf

    def look(self, message: FileMessage, units: Units) -> FileAnswer:
        """The answer on the file: its kind, its content, its mistakes. Raises PageError where there is no file."""
        dropped = self._held(message)
        size = sum(len(one.data) for one in dropped.all)
        answer: FileAnswer = {"name": dropped.name, "kind": dropped.kind, "bytes": size, "error": ""}
        answer["there"] = bool(self._there(dropped))
        look = {"mission": self._mission, "zones": self._zones, "ground": self._ground}[dropped.kind]
        try:
            answer |= look(dropped, message, units)
        except Cancelled:
            answer["error"] = "a change came before the check was done: check again"
        except GcsplanError as why:
            answer["error"] = words_of(why)
        return answer

    def take(self, message: FileMessage) -> None:
        """Make the file a part of the mission, one step of undo. Raises PageError, InputError."""
        dropped = self._held(message)
        try:
            if dropped.kind == "mission":
                self._take_route(dropped, message)
            elif dropped.kind == "zones":
                self._take_zones(dropped, message)
            else:
                self._take_ground(dropped, message)
        except PageError:
            raise
        except InputError as why:
            raise PageError(words_of(why), code="bad_file") from why
        self._shelf.clear()

    def _held(self, message: FileMessage) -> Dropped:
        """The file, as a file of zones if the page wants the fence of a mission."""
        try:
            held = self._shelf.held
        except InputError as why:
            raise PageError(str(why), code="bad_file") from None
        fence = message.get("kind") == "zones" and may_be_zones(held.name)
        return replace(held, kind="zones") if fence else held

    # -- a mission for a vehicle ---------------------------------------------------------------------------------

    def _number(self, message: FileMessage, name: str) -> int:
        """The vehicle of the mission that the file is for: the page's choice, the one of its name, or the first."""
        names = [str(v["name"]) for v in vehicles_of(self._edits.document, None)]
        chosen = message.get("vehicle")
        if isinstance(chosen, int) and not isinstance(chosen, bool) and 0 <= chosen < len(names):
            return chosen
        stem = Path(name).stem
        return names.index(stem) if stem in names else 0

    def _mission(self, dropped: Dropped, message: FileMessage, units: Units) -> FileAnswer:
        vehicles = vehicles_of(self._edits.document, None)
        number = self._number(message, dropped.name)
        answer: FileAnswer = {"vehicle": number, "vehicles": [v["name"] for v in vehicles], "route": None,
                      "fence": may_be_zones(dropped.name)}  # fmt: skip
        with suppress(InputError):  # what cannot be read, the check says in its words
            read = self._read_mission(dropped)
            answer["fence"] = bool(read.fence) or read.unread_fence is not None or not read.mission.items
            answer["route"] = _route_answer(route_of(read.mission, dropped.name))
        planner = self._edits.planner
        if planner is None:
            words = "it is checked as soon as there is a mission: choose the ground, then start and goal"
            return answer | {"error": words}
        try:
            source = planner.loaded()
        except InputError as why:
            return answer | {"error": f"the mission has mistakes, so nothing is checked in it:\n{mistakes_text(why)}"}
        argument = f"{vehicles[number]['name']}={dropped.name}"
        held = {str(split_name(argument)[1]): dropped.data}
        batch = check_batch(source, [argument], held=held, returns=Returns(judged=True))
        if batch.unreadable:
            return answer | {"error": words_of(batch.unreadable[0][1])}
        return answer | checked_answer(batch.checked[0], units)

    @staticmethod
    def _read_mission(dropped: Dropped) -> MissionFileRead:
        return read_mission_file(
            Path(dropped.name), autopilot=None, otherwise=Autopilot.ARDUCOPTER, data=dropped.data
        )  # fmt: skip

    def _take_route(self, dropped: Dropped, message: FileMessage) -> None:
        route, edits = route_of(self._read_mission(dropped).mission, dropped.name), self._edits
        vehicle = f"vehicles[{self._number(message, dropped.name)}]"
        if edits.document.get("frame") is not None:
            raise InputError("the mission is in local metres: begin a new one", where=dropped.name)
        ends: dict[str, Any] = {f"{vehicle}.goal": list(route.goal)}
        if route.start is not None:
            ends[f"{vehicle}.start"] = list(route.start)
        through = message.get("through") is not False and bool(route.via)
        via = {f"{vehicle}.via": [list(p) for p in route.via] if through else None}
        if edits.planner is None:
            edits.change(ends, live=False)
        if edits.planner is not None:
            edits.make({**ends, **via})

    # -- zones ---------------------------------------------------------------------------------------------------

    def _entry(self, dropped: Dropped, message: FileMessage) -> tuple[str, dict[str, Any], ZoneKeys]:
        """The list that the zones join, and their entry. Raises InputError for settings that are wrong."""
        name = message.get("as") if message.get("as") in ZONE_LISTS else ZONE_LISTS[0]
        entry = {"file": dropped.name, **_settings(message, ZONE_SETTINGS)}
        problems: list[Mistake] = []
        keys = read_section(ZoneKeys, entry, str(name), problems)
        if keys is None or problems:
            raise InputError.of(problems)
        return str(name), entry, keys

    def _read(self, dropped: Dropped, message: FileMessage) -> tuple[list[ZoneDraft], list[Note]]:
        name, _, keys = self._entry(dropped, message)
        hours = hours_of(None, None, "at", [], instead=texts_of(self._edits.document.get("at")))
        policy = Policy(hours=hours, where=name, on_bad=keys.on_bad, ignore=tuple(keys.ignore))
        found = read_zones(
            Path(dropped.name), where=name, radius_m=keys.radius_m, buffer_m=keys.buffer_m, layer=keys.layer,
            policy=policy, keep_in=name == "keep_in", data=dropped.data,
        )  # fmt: skip
        if found.problems:
            raise InputError.of(found.problems)
        used, notes = listed(found.zones)
        return used, [*found.notes, *notes, *zone_notes([(draft, None) for draft in used])]

    def _zones(self, dropped: Dropped, message: FileMessage, units: Units) -> FileAnswer:
        drafts, notes = self._read(dropped, message)
        name, entry, _ = self._entry(dropped, message)
        drawn = DrawnZones().geojson({name: [entry]}, {f"{name}[0]": drafts[:MOST_DRAWN]}, None, units)
        return {"as": name, "zones": drawn, "count": len(drafts), "notes": _texts(notes, Wording(units))}

    def _take_zones(self, dropped: Dropped, message: FileMessage) -> None:
        if self._edits.planner is None:
            raise InputError("zones belong to a mission: choose start and goal first", where=dropped.name)
        self._read(dropped, message)
        name, entry, _ = self._entry(dropped, message)
        self._write(dropped, message)
        self._edits.make({f"{name}[{len(self._edits.document.get(name) or ())}]": entry})

    # -- terrain -------------------------------------------------------------------------------------------------

    def _section(self, dropped: Dropped, message: FileMessage) -> dict[str, Any]:
        now = self._edits.document.get("terrain")
        stays = {key: now[key] for key in GROUND_STAYS if isinstance(now, dict) and key in now}
        names = dropped.rasters
        if not names:
            raise InputError("this belongs to a raster: drop it together with that", where=dropped.name)
        return {"dem": names if len(names) > 1 else names[0], **_settings(message, GROUND_SETTINGS), **stays}

    def _ground(self, dropped: Dropped, message: FileMessage, units: Units) -> FileAnswer:
        problems: list[Mistake] = []
        section = self._section(dropped, message)
        if "canopy" in section:  # a file of the mission's folder
            section["canopy"] = str(self._edits.store.folder / str(section["canopy"]))
        keys = read_section(TerrainKeys, section, "terrain", problems)
        if keys is None or problems:
            raise InputError.of(problems)
        with laid_out(dropped) as folder:
            try:
                return self._ground_in(folder, dropped, keys, units)
            except InputError as why:
                raise InputError(words_of(why).replace(f"{folder}{os.sep}", "")) from None

    def _ground_in(self, folder: Path, dropped: Dropped, keys: TerrainKeys, units: Units) -> FileAnswer:
        terrain = opened(make_spec(keys, folder), where="terrain")
        of_vehicles = [name for name in dropped.rasters if ending_of(name) == DAT_SUFFIX.lower()]  # no rasters
        rasters = [
            open_raster(folder / name, where="terrain.dem", crs=keys.crs, height_unit=keys.height_unit)
            for name in dropped.rasters if name not in of_vehicles
        ]  # fmt: skip
        outside = [file for raster in rasters for file in raster.files if file.resolve().parent != folder]
        if outside:
            words = f"names {outside[0].name}, which was not dropped: drop it together with all files that it names"
            raise InputError(words, where=dropped.name)
        places = [p for v in vehicles_of(self._edits.document, None) for p in (v["start"], v["goal"], *v["via"]) if p]
        inside = np.asarray(terrain.covers(*np.array(places).T)) if places else np.zeros(0, bool)
        stated = {raster.vertical.name for raster in rasters if raster.vertical is not None}
        return {
            "bounds": bounds_of(terrain), "files": [one.name for one in dropped.all],
            "cells": [[raster.cols, raster.rows] for raster in rasters][:MOST_ON_PAGE],
            "height_unit": ", ".join(sorted({raster.unit.name for raster in rasters})) or METRE.name,
            "vertical_datum": keys.vertical_datum or ", ".join(sorted(stated)) or None,
            "notes": _texts([note for raster in rasters for note in raster.notes], Wording(units)),
            "places": len(places), "beside": int((~inside).sum()),
        }  # fmt: skip

    def _take_ground(self, dropped: Dropped, message: FileMessage) -> None:
        self._ground(dropped, message, METRIC)
        self._write(dropped, message)
        if self._edits.planner is not None:
            self._edits.make({"terrain": self._section(dropped, message)})

    def _write(self, dropped: Dropped, message: FileMessage) -> None:
        """Write the file into the mission's folder; another one of its name only with the user's word."""
        there = self._there(dropped)
        if there and message.get("over") is not True:
            words = f"another {there[0]} lies in the folder of the mission: replace it, or rename the file"
            raise PageError(words, code="file_exists", where="dropped")
        place_in(self._edits.store.folder, dropped)
        if self._edits.planner is not None:
            self._edits.planner.reload()  # what it read of an older file of this name does not count

    def _there(self, dropped: Dropped) -> list[str]:
        """The names of which the mission's folder has another file."""
        return [one.name for one in dropped.all if has_other(self._edits.store.folder / one.name, one.data)]


def words_of(why: GcsplanError) -> str:
    """The mistakes of an error, one a line, each with its place; no folder of this machine."""
    problems = why.problems if isinstance(why, InputError) else ()
    return "\n".join(str(p) for p in problems[:MOST_ON_PAGE]) or str(why)


def checked_answer(c: Checked, units: Units) -> FileAnswer:
    """The verdict on a file as `gcsplan check` has it: its line and profile, its findings with their places."""
    wording, verdict = c.wording(units), c.verdict
    line = line_of(verdict, c.world, c.vehicle.limits, samples=PROFILE_SAMPLES)
    findings = [
        {
            "item": f.seq, "kind": f.kind, "text": f.note.text(wording, placed=False),
            "at": _finite((f.lat_deg, f.lon_deg)), "distance_m": _along(line, verdict, f.seq, c.world.frame,
                                                                        (f.lat_deg, f.lon_deg)),
        }
        for f in verdict.findings[:MOST_ON_PAGE]
    ]  # fmt: skip
    home = None if c.way_home is None else c.way_home.safe
    passes = failing_of(c, allow_unjudged=False) is None
    return {
        "verdict": verdict_word(home if verdict.safe is True and not passes else verdict.safe), "passes": passes,
        "return_safe": home,
        "headline": verdict_words(verdict.safe, c.way_home).text(wording),
        "line": flown_line(verdict), "profile": None if line is None else profile_of(line, c.world.frame),
        "items": placed_items(verdict.mission), "findings": findings,
        "findings_count": len(verdict.findings),
        "not_judged": [{"item": n.item, "text": n.text(wording)} for n in verdict.not_judged[:MOST_ON_PAGE]],
        "way_home": home_lines(c, wording)[:MOST_ON_PAGE], "notes": _texts(c.notes, wording),
    }  # fmt: skip


def placed_items(mission: Mission) -> list[FileAnswer]:
    """The items that have a place: number, command in words, and where."""
    items = enumerate(mission.wire_items())
    placed = [(k, i) for k, i in items if i.command in HAS_PLACE and i.frame != NO_POSITION and (i.x or i.y)]
    home = 0 if mission.autopilot.is_ardupilot else None
    return [
        {"item": k, "name": "home" if k == home else command_name(i.command), "at": [i.lat_deg, i.lon_deg]}
        for k, i in placed[:MOST_DRAWN]
    ]


def _along(
    line: TrackLine | None, verdict: Verdict, seq: int, frame: Frame, at: tuple[float, float]
) -> float | None:  # fmt: skip
    """How far along the line a place of item ``seq`` lies, m: at the nearest sample of its legs."""
    if line is None or not all(map(math.isfinite, at)):
        return None
    of_item = np.array([leg.seq == seq for leg in verdict.legs])[line.leg]
    samples = np.flatnonzero(of_item) if of_item.any() else np.arange(len(line.run_m))
    east, north = frame.to_plane(*at).T
    away_m = np.hypot(line.east_m[samples] - east, line.north_m[samples] - north)
    return float(line.run_m[samples[int(np.argmin(away_m))]])


def _finite(at: tuple[float, float]) -> list[float] | None:
    return list(at) if all(map(math.isfinite, at)) else None


def _texts(notes: Sequence[Note], wording: Wording) -> list[str]:
    return [note.text(wording) for note in dict.fromkeys(notes)][:MOST_ON_PAGE]


def _route_answer(route: FileRoute) -> FileAnswer:
    return {"start": route.start, "goal": route.goal, "via": len(route.via), "left_out": list(route.left_out)}


def _settings(message: FileMessage, keys: Sequence[str]) -> dict[str, Any]:
    """The settings that a message gives with a file, without the empty ones."""
    given = message.get("settings")
    found = given if isinstance(given, dict) else {}
    return {key: found[key] for key in keys if found.get(key) not in (None, "", [])}
