"""`Edits`: the mission that the page edits: its document with undo and redo, its living session, and its file.

A mission that begins from nothing is a draft until it has a start and a goal.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from gcsplan.app.session import Planner
from gcsplan.dem.cache import Cache
from gcsplan.dem.sources import SOURCES
from gcsplan.errors import GcsplanError, InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.changes import saved_text
from gcsplan.mission_file.new_file import Draft, place_text, text_of
from gcsplan.mission_file.source import is_sample, read_content
from gcsplan.page.fleet.crew_changes import with_crew
from gcsplan.page.form import require_changes, require_own_files, without_empty
from gcsplan.page.history import EditedDocument, EditHistory
from gcsplan.page.places import place_of, with_heights
from gcsplan.page.refused import PageError
from gcsplan.page.store import UNNAMED_FILE, MissionStore
from gcsplan.vehicle import Autopilot
from gcsplan.world.terrain.input_files import TERRAIN_FILES
from gcsplan.world.terrain.sample import SAMPLE

PRESETS = {"copter": Autopilot.ARDUCOPTER, "wing": Autopilot.ARDUPLANE, "px4": Autopilot.PX4}
"""Kinds of aircraft that the page offers."""

MOST_FILES, MOST_LOOKED_AT = 200, 5000
"""Most terrain files of the folder that the page offers, and most names of it that are looked at."""

MOST_TEXT_BYTES = 200_000
"""Most bytes of a mission that is edited as a text on the page: it is one message."""

DRAFT_ENDS = {"vehicles[0].start": "start", "vehicles[0].goal": "goal"}
"""The keys that make a draft a mission."""


class Edits:
    """One mission; for one thread at a time. ``store`` is its file, ``planner`` its session, None without both ends."""

    def __init__(self, store: MissionStore) -> None:
        self.store = store
        self.planner: Planner | None = None
        self.restored = False
        self._history = EditHistory()
        self._live: dict[str, object] = {}
        self._draft: Draft | None = None
        self._ends: dict[str, Any] = {}
        self._saved: EditedDocument | None = None  # the state that the file holds

    @classmethod
    def of_file(cls, mission: Path) -> Edits:
        """The mission of a file or a sample, with unsaved edits of an earlier run. Raises InputError."""
        source = load_mission(mission)
        assert source.content is not None
        sample = is_sample(mission)
        folder = Path() if sample else mission.parent
        edits = cls(MissionStore(folder.absolute(), None if sample else mission.absolute(), source.content.text))
        edits.planner = Planner(source)
        edits._saved = edits._state
        if not sample:
            edits._restore(edits.store.kept())
        edits._history = EditHistory.kept(edits.store.place, edits._state) or edits._history
        return edits

    @classmethod
    def of_folder(cls, folder: Path) -> Edits:
        """No mission yet, but for the unsaved one of an earlier run that has no file."""
        edits = cls(MissionStore(folder.absolute(), None, None))
        kept = edits.store.kept()
        if kept is not None and edits.store.text is not None:
            with suppress(InputError):
                edits.planner = Planner(load_mission(edits.store.place, text=edits.store.text))
                edits._restore(kept)
                edits._history = EditHistory.kept(edits.store.place, edits._state) or edits._history
        return edits

    @property
    def stage(self) -> str:
        """The protocol's word for what there is: ``empty``, ``draft`` or ``mission``."""
        return "mission" if self.planner is not None else "empty" if self._draft is None else "draft"

    @property
    def document(self) -> EditedDocument:
        """A copy of the document; of a draft the keys that it has."""
        if self.planner is not None:
            return self.planner.mission
        draft = self._draft
        if draft is None:
            return {}
        terrain: dict[str, Any] = {"flat_m": draft.flat_m} if not draft.dem else {"dem": list(draft.dem)}
        if draft.vertical_datum is not None:
            terrain["vertical_datum"] = draft.vertical_datum
        vehicle = {"name": f"uav{draft.sysid}", "autopilot": draft.autopilot.value, **self._ends}
        return {"terrain": terrain, "vehicles": [vehicle]}

    @property
    def live(self) -> Mapping[str, object]:
        """The changes of the point that is being dragged, which the document does not have yet."""
        return self._live

    @property
    def is_saved(self) -> bool:
        """Whether the file holds all edits."""
        return self.planner is None or self._state == self._saved

    @property
    def can_undo(self) -> bool:
        """See `EditHistory`."""
        return self._history.can_undo

    @property
    def can_redo(self) -> bool:
        """See `EditHistory`."""
        return self._history.can_redo

    # -- changes -------------------------------------------------------------------------------------------------

    def change(self, given: object, *, live: bool) -> None:
        """Change keys, all or none; ``live`` until the point is dropped. Raises PageError, InputError."""
        changes = dict(require_changes(given))
        if self.planner is None:
            self._change_draft(changes)
            return
        for place, value in changes.items():
            if place.endswith(".via"):
                number = int(place[len("vehicles[") : place.index("]")])
                vehicles = self.planner.mission.get("vehicles") or []
                old = vehicles[number].get("via") if number < len(vehicles) else None
                changes[place] = with_heights(old, value)
        if live:
            self._live |= changes
            return
        self.make(without_empty(self.planner.mission, changes))

    def make(self, changes: Mapping[str, object]) -> None:
        """Change any keys of a mission, which the server itself has checked; one step of undo. Raises PageError."""
        if self.planner is None:
            raise PageError("there is no mission yet: choose the ground first", code="bad_change")
        self._live.clear()
        before = self._state
        try:
            self.planner.change(with_crew(before["mission"], changes))
        except InputError as why:
            raise PageError(why.message, code="bad_change", where=next(iter(changes))) from why
        if self.planner.mission != before["mission"]:
            self._history.step(before)

    @property
    def _state(self) -> EditedDocument:
        """What a step of undo brings back: the document, and the text that it is written into."""
        return {"mission": self.document, "text": self.store.text}

    def cancel(self) -> None:
        """Forget the changes of a drag that was broken off."""
        self._live.clear()

    def undo(self) -> None:
        """Back to the document before the last step."""
        self._moved(self._history.undo(self._state))

    def redo(self) -> None:
        """Again to the document that was undone."""
        self._moved(self._history.redo(self._state))

    def _moved(self, state: EditedDocument | None) -> None:
        self._live.clear()
        if state is not None and self.planner is not None:
            self.planner.restore(state["mission"])
            self.store.text = state["text"]

    # -- the text ------------------------------------------------------------------------------------------------

    @property
    def text(self) -> str:
        """The text that a save would write. Raises PageError."""
        if self.planner is None or self.store.text is None:
            raise PageError("there is no text yet: give a start and a goal", code="bad_text")
        try:
            text = saved_text(self.store.text, self.planner.mission, self.store.place.name)
        except InputError as why:
            raise PageError(str(why), code="bad_text") from why
        if len(text.encode()) > MOST_TEXT_BYTES:
            words = f"the text has more than {MOST_TEXT_BYTES} bytes: edit the file itself, the page sees the change"
            raise PageError(words, code="bad_text")
        return text

    def write(self, text: object) -> None:
        """Take a whole text as the mission's own, one step of undo. Raises InputError: the mission stays as it is."""
        if self.planner is None:
            raise PageError("there is no mission yet: choose the ground first", code="bad_text")
        if not isinstance(text, str):
            raise PageError("the text of a mission is text", code="bad_message", where="text")
        before, place = self._state, self.store.place
        _, _, document, _, _ = read_content(place, text)
        require_own_files(document, before["mission"], self.store.folder, text)  # before any of them is opened
        load_mission(place, text=text)
        self.planner.restore(document)
        self.store.text = text
        self._live.clear()
        if self._state != before:
            self._history.step(before)

    # -- files ---------------------------------------------------------------------------------------------------

    def reload(self) -> None:
        """Take the file as it is on the disk; undo leads back to the edits. Raises InputError."""
        if self.planner is None:
            raise PageError("there is no file to read again", code="bad_message")
        before = self._state
        document, text = self.store.reread()
        load_mission(self.store.place, text=text)
        self.planner.restore(document)
        self.store.take(text)
        self.planner.reload()
        self._history.step(before)
        self._live.clear()
        self._saved = self._state

    def save(self, name: object, *, over: bool) -> Path:
        """Write the mission into its file, or into a new one of the folder. Raises PageError."""
        if self.planner is None:
            raise PageError("there is nothing to save yet: give a start and a goal", code="not_saved")
        if name is not None and not isinstance(name, str):
            raise PageError("the name of a file is text", code="bad_message", where="name")
        document = self.planner.mission
        named = Path(name or "")
        if self.store.file is None and document.get("name") == Path(UNNAMED_FILE).stem:
            document["name"] = named.stem
            self.store.text = (self.store.text or "").replace(
                f"gcsplan plan {UNNAMED_FILE}\n", f"gcsplan plan {shlex.quote(named.name)}\n", 1
            )
        file = self.store.save(document, name, over=over)
        self.planner.restore(document)
        self._saved, self.restored = self._state, False
        return file

    def keep(self) -> bool:
        """Keep unsaved edits beside the mission, and the steps of undo; whether there are unsaved edits.

        Raises InputError."""
        if self.planner is not None:
            self._history.keep(self.store.place, self._state)
        if self.is_saved:
            self.store.forget()
            return False
        self.store.keep(self.document)
        return True

    # -- from nothing --------------------------------------------------------------------------------------------

    def begin(self, message: Mapping[str, Any]) -> None:
        """Begin a new mission, as the page's ``new`` says. Raises PageError, InputError."""
        preset = message.get("preset")
        if not isinstance(preset, str) or preset not in PRESETS:
            raise PageError(f"preset is one of {', '.join(PRESETS)}", code="bad_message", where="preset")
        folder = self.store.folder
        dem, flat_m, datum = _ground(message.get("terrain"), folder)
        least, most = _metres(message, "min_agl_m"), _metres(message, "max_agl_m")
        draft = Draft(start="", goal="", dem=dem, flat_m=flat_m, vertical_datum=datum,
                      autopilot=PRESETS[preset], max_agl_m=most)  # fmt: skip
        if self.planner is not None:
            self.keep()  # what is not saved stays beside its own file
        self.store = MissionStore(folder, None, None)
        self.planner, self._history, self.restored, self._saved = None, EditHistory(), False, None
        self._live.clear()
        self._draft = draft if least is None else replace(draft, min_agl_m=least)
        self._ends = {}
        given = {place: message.get(key) for place, key in DRAFT_ENDS.items() if message.get(key) is not None}
        if given:
            self._change_draft(given)

    def _change_draft(self, changes: Mapping[str, object]) -> None:
        """Set the ends of a draft; with both it becomes a mission. Raises PageError, InputError."""
        if self._draft is None:
            raise PageError("there is no mission yet: choose the ground first", code="bad_change")
        for place, value in changes.items():
            if place not in DRAFT_ENDS:
                raise PageError("this comes after the start and the goal", code="bad_change", where=place)
            if place_of(value, None) is None:
                raise PageError("this is no place", code="bad_change", where=place)
            self._ends[DRAFT_ENDS[place]] = value
        if len(self._ends) == len(DRAFT_ENDS):
            ends = replace(self._draft, start=_text(self._ends["start"]), goal=_text(self._ends["goal"]))
            text = text_of(ends, UNNAMED_FILE, Path(UNNAMED_FILE).stem)
            self.store.text = text
            self.planner = Planner(load_mission(self.store.place, text=text))

    def _restore(self, kept: EditedDocument | None) -> None:
        """Take the unsaved edits of an earlier run, which undo takes back."""
        assert self.planner is not None
        if kept is None or {"mission": kept, "text": self.store.text} == self._saved:
            return
        before = self._saved or self._state
        try:
            self.planner.restore(kept)
        except GcsplanError:
            return
        self._history.step(before)
        self.restored = True


def terrain_choices(folder: Path) -> list[str]:
    """What the page offers as ground: the sample, published sources with tiles in the cache, files of the folder."""
    fetched = [name for name, source in SOURCES.items() if Cache(source).folder.is_dir()]
    try:
        names = sorted(p.name for p in islice(folder.iterdir(), MOST_LOOKED_AT) if p.suffix.lower() in TERRAIN_FILES)
    except OSError:
        names = []
    return [SAMPLE, *fetched, *names[:MOST_FILES]]


def _ground(terrain: object, folder: Path) -> tuple[tuple[str, ...], float | None, str | None]:
    """Rasters, or the height of flat ground, and the vertical datum. Raises PageError: no file outside the folder."""
    given = terrain if isinstance(terrain, dict) else {}
    flat_m, dem, datum = given.get("flat_m"), given.get("dem"), given.get("vertical_datum")
    if not given.keys() <= {"flat_m", "dem", "vertical_datum"} or (flat_m is None) == (dem is None):
        raise PageError("terrain has flat_m, or dem (with vertical_datum)", code="bad_message", where="terrain")
    if datum is not None and (not isinstance(datum, str) or len(datum) > 100):
        raise PageError("vertical_datum is a name such as EGM96", code="bad_message", where="terrain.vertical_datum")
    if dem is None:
        return (), _metres(given, "flat_m"), None
    names = dem if isinstance(dem, list) else [dem]
    known = terrain_choices(folder)
    if not names or not all(isinstance(name, str) and name in known for name in names):
        words = "the ground is a file of the mission's folder, or one of the others that are offered"
        raise PageError(words, code="bad_change", where="terrain.dem")
    return tuple(names), None, datum or None


def _metres(message: Mapping[str, Any], key: str) -> float | None:
    value = message.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not -500.0 <= value <= 10_000.0:
        raise PageError("give metres, -500 to 10 000", code="bad_message", where=key)
    return float(value)


def _text(value: object) -> str:
    """A place as `Draft` takes it. Raises PageError."""
    if isinstance(value, list) and len(value) == 2:
        return json.dumps([round(float(v), 7) for v in value])
    try:
        return place_text(str(value))
    except ValueError as why:
        raise PageError(str(why), code="bad_change", where="place") from None
