"""Changes of a mission document, made before it is read: one change of a key, an added zone, other zones.

`changed` makes them in the mapping that is read, and `saved_text` writes the same mapping into the text of the file. A
plan with options and a plan of the saved file therefore read equal documents. All other bytes of the text stay.
"""

from __future__ import annotations

import codecs
import copy
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from gcsplan.errors import InputError, UsageError
from gcsplan.export.durable import write_whole
from gcsplan.mission_file.request import Content
from gcsplan.mission_file.source import is_sample
from gcsplan.mission_file.values.document import flow, with_document
from gcsplan.mission_file.values.schema import nearest
from gcsplan.mission_file.values.units import other_names
from gcsplan.mission_file.values.yaml import read_yaml
from gcsplan.notes.note import Note

MOST_CHARACTERS = 100
"""Most characters of a value that a note on its change repeats."""


@dataclass(frozen=True, slots=True)
class MissionChange:
    """One change of a mission document; ``option`` is what the user typed for it, empty for a caller's own change.

    ``part``: the whole section ``wind:`` (whose forecast is relative to the current folder), a key of ``terrain:``, a
    ``limit`` (of every vehicle, or of the one that is named), a key of a
    ``vehicle``, one more ``zone``, or a file whose ``zones`` count in place of ``no_fly``. A ``value`` of a zone is its
    entry; files in it are relative to the current folder.
    """

    option: str
    part: Literal["wind", "terrain", "limit", "vehicle", "zone", "zones"]
    key: str
    value: Any
    vehicle: str | None = None


@dataclass(frozen=True, slots=True)
class ChangedMission:
    """A document after its changes: the mapping, a note on each change, and the option by the key that it set."""

    raw: dict[str, Any]
    notes: tuple[Note, ...] = ()
    options: tuple[tuple[str, str], ...] = ()


def changed(raw: Mapping[str, Any], changes: Sequence[MissionChange], folder: Path) -> ChangedMission:
    """The document ``raw`` of a mission in ``folder`` with all changes made, in order; ``raw`` itself stays.

    A part of another type than it must have is left for the reader to refuse. Raises UsageError for a vehicle that the
    document lacks, or that has to be named.
    """
    made = _Changes(copy.deepcopy(dict(raw)), folder)
    for change in changes:
        match change.part:
            case "wind":
                made.wind(change)
            case "terrain":
                made.put(made.raw.get("terrain"), "terrain", change)
            case "limit":
                made.limit(change)
            case "vehicle":
                made.vehicle(change)
            case "zone" | "zones":
                made.zone(change)
    return ChangedMission(made.raw, tuple(made.notes), tuple(made.options.items()))


class _Changes:
    """A document on its way through its changes."""

    def __init__(self, raw: dict[str, Any], folder: Path) -> None:
        self.raw, self.folder = raw, folder
        self.notes: list[Note] = []
        self.options: dict[str, str] = {}

    def put(self, section: Any, where: str, change: MissionChange) -> None:
        """Set the key of a section, also where it stands in another unit."""
        if not isinstance(section, dict):
            return
        names = [change.key, *other_names([change.key])]
        was = {name: section.pop(name) for name in names[1:] if name in section}
        if change.key in section:
            was = {change.key: section[change.key]}
        section[change.key] = change.value
        before = _shown(next(iter(was.values()))) if was else ""
        place, now = f"{where}.{change.key}".lstrip("."), _shown(change.value)
        if not change.option:
            return
        self.options[place] = change.option
        other = next((f"{name}: {before}" for name in was if name != change.key), before)
        self.notes.append(
            Note("change_of_key", option=change.option, key_path=place, now=now, was=other)
            if was
            else Note("change_adds_key", option=change.option, key_path=place, now=now)
        )

    def wind(self, change: MissionChange) -> None:
        """Let other winds count in place of the mission's own."""
        keys = dict(change.value)
        if "forecast" in keys:
            keys["forecast"] = _beside(self.folder, keys["forecast"])
        self.put(self.raw, "", replace(change, value=keys))

    def limit(self, change: MissionChange) -> None:
        """Set a limit for all vehicles, also for each that has its own, or for the named one alone."""
        names = {change.key, *other_names([change.key])}
        vehicles = self._named(change.vehicle) if change.vehicle is not None else self._vehicles()
        if change.vehicle is None:
            if self.raw.get("limits") is None:
                self.raw["limits"] = {}
            self.put(self.raw["limits"], "limits", change)
        for i, vehicle in vehicles:
            own = vehicle.get("limits")
            places: list[tuple[Any, str]] = [(vehicle, f"vehicles[{i}]"), (own, f"vehicles[{i}].limits")]
            holding = [
                (section, where) for section, where in places if isinstance(section, dict) and names & set(section)
            ]
            if change.vehicle is not None:
                holding = holding or places[:1]
            for section, where in holding:
                self.put(section, where, change)

    def vehicle(self, change: MissionChange) -> None:
        """Set a key of the vehicle that is named, of the only one, or, for a speed, of every one."""
        vehicles = self._named(change.vehicle) if change.vehicle is not None else self._vehicles()
        if change.vehicle is None and len(vehicles) > 1 and change.key != "speed_m_s":
            option = change.option.partition(" ")[0]
            raise UsageError(f"{option}: the mission has {len(vehicles)} vehicles; name one: {option} "
                             f"{vehicles[0][1].get('name')}=…")  # fmt: skip
        for i, vehicle in vehicles:
            self.put(vehicle, f"vehicles[{i}]", change)

    def zone(self, change: MissionChange) -> None:
        """Add a zone or a file of zones, or let the file count in place of all zones."""
        entry = dict(change.value)
        if "file" in entry:
            entry["file"] = _beside(self.folder, entry["file"])
        zones = self.raw.get("no_fly")
        if not isinstance(zones, list | None):
            return
        before = zones or []
        if "file" not in entry:
            entry = {"name": _free_name(before), **entry}
        self.raw["no_fly"] = [entry] if change.part == "zones" else [*before, entry]
        self.options[f"no_fly[{len(self.raw['no_fly']) - 1}]"] = change.option
        self.notes.append(
            Note("change_of_zones", option=change.option, now=_shown(entry), count=len(before))
            if change.part == "zones"
            else Note("change_adds_zone", option=change.option, now=_shown(entry))
        )

    def _vehicles(self) -> list[tuple[int, dict[str, Any]]]:
        vehicles = self.raw.get("vehicles")
        return [(i, v) for i, v in enumerate(vehicles) if isinstance(v, dict)] if isinstance(vehicles, list) else []

    def _named(self, name: str) -> list[tuple[int, dict[str, Any]]]:
        found = [(i, v) for i, v in self._vehicles() if v.get("name") == name]
        if not found:
            known = [str(v.get("name")) for _, v in self._vehicles()]
            near = nearest(name, known) or f"; there is {', '.join(known[:10])}"
            raise UsageError(f"the mission has no vehicle {name[:64]!r}{near}")
        return found


def saved_text(text: str, raw: Mapping[str, Any], where: str) -> str:
    """The ``text`` of a mission file with the changed document ``raw`` in it; all else keeps its bytes.

    Raises UsageError where the text cannot hold the change in its place, such as behind an alias (``*name``).
    """
    new = with_document(text, dict(raw))
    try:
        same = new is not None and read_yaml(new, where=where) == raw
    except InputError:
        same = False
    if new is None or not same:
        raise UsageError(
            "--save cannot write these changes into this file: a changed part is shared by an alias or a merge (`*`, "
            "`<<`), or written in an unusual way; write them with an editor, or plan without --save",
            where=where,
        )
    return new


def saving(content: Content) -> Callable[[], None]:
    """The function that writes a mission's changes into its file, whole or not at all; what refuses it is found now.

    Raises UsageError for a mission that is no file of the user's, without a change, or whose text cannot hold them; the
    function raises InputError where the file cannot be written, or is another one by then.
    """
    file, where = content.file, content.where
    if not content.changes:
        raise UsageError("--save has nothing to write; give a change, such as --avoid 36.61,-84.31,400")
    if content.text is None or is_sample(where):
        raise UsageError(f"--save writes into a mission file, and {where} is none of yours; copy it first")
    text = saved_text(content.text, content.given, where)

    def save() -> None:
        try:
            target = file.resolve()
            data = target.read_bytes()
        except (OSError, RuntimeError) as why:
            raise InputError(f"the changes are not saved: {why}", where=where) from None
        if data.decode("utf-8-sig", "replace") != content.text:
            raise InputError("the changes are not saved, for the file was changed meanwhile; plan again", where=where)
        mark = codecs.BOM_UTF8 if data.startswith(codecs.BOM_UTF8) else b""
        write_whole(target, mark + text.encode())

    return save


def _shown(value: Any) -> str:
    """A value for a note: as it stands in a file, cut where it is long."""
    text = flow(value)
    return text if len(text) <= MOST_CHARACTERS else f"{text[:MOST_CHARACTERS]}…"


def _beside(folder: Path, file: str) -> str:
    """The path of a file as a mission in ``folder`` names it."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # on another drive
        return os.path.abspath(file)


def _free_name(zones: Sequence[Any]) -> str:
    """A name that no zone of the file has."""
    taken = {zone.get("name") for zone in zones if isinstance(zone, dict)}
    return next(name for n in range(1, len(zones) + 2) if (name := f"avoid {n}") not in taken)
