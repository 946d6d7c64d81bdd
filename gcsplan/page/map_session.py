"""`MapSession`: takes the page's messages in order, edits, plans, and answers; in one thread of its own.

While a point is dragged, a plan runs to its first safe path, and then the newest place counts: the ones between are
left out. Any other message ends the plan that it supersedes.
"""

from __future__ import annotations

import queue
import re
import threading
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.app.plan.way_home import home_of, homes_of, is_required
from gcsplan.app.session import BetterPath, Planner, path_of
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.errors import Cancelled, GcsplanError, InputError, Mistake, NoMission, cancelled_by
from gcsplan.mission_file.kept import KeptWorld
from gcsplan.mission_file.load import MOST_VEHICLES_OF_FILE, zones_by_entry
from gcsplan.mission_file.request import Content
from gcsplan.page import answers
from gcsplan.page.drop import DroppedFile
from gcsplan.page.dropped.shelf import GROUND_ENDINGS, Shelf, endings
from gcsplan.page.edits import Edits, terrain_choices
from gcsplan.page.fleet.crew_changes import arrival_of
from gcsplan.page.fleet.scene import scene_answer
from gcsplan.page.form import arranged, changes_of, section_form, short_form
from gcsplan.page.ground_tiles import LEAST_ZOOM, MOST_ZOOM, GroundTiles, contour_interval_m
from gcsplan.page.history import EditedDocument
from gcsplan.page.places import read_text, vehicles_of
from gcsplan.page.refused import PageError
from gcsplan.page.zone_features import DrawnZones
from gcsplan.units import SYSTEMS, Units
from gcsplan.world.geodesy.frame import Frame

PageMessage = dict[str, Any]
SendAnswer = Callable[[PageMessage], None]

LIVE_S, LIVE_MOST_S = 0.25, 2.0
"""A live plan that has no path after this many seconds gives way to a newer place; where paths take longer, after up to
the second number of seconds, so that some come while the pointer moves."""

IDLE_S = 1.0
"""Seconds between two looks at the disk, and after the last edit until unsaved ones are kept."""

MOST_MESSAGES_WAITING = 1000
"""Most messages that wait; live ones of one drag are joined."""

DRAGGED_ALONE = {"planner.name": "optimal", "planner.gap_percent": 100.0, "planner.budget_s": 0.05}
"""Keys with which a plan ends with the path of the drag, if that is legal."""

_PLACE_OF = re.compile(r"vehicles\[(\d+)\]\.(?:start|goal|via)$")

SPARE_DEG = 0.01
"""Degrees around a mission where the map opens."""


ANSWERED_BY = {"place": "place", "section": "section", "text": "text", "inspect": "dropped"}
"""Messages that change nothing, each with the type of its answer."""

SHOWN = ("vehicle", "scene")
"""Messages on what the page shows."""


class StepTaker(Protocol):
    """What takes the steps from the page to files and vehicles: `gcsplan.page.steps`, which knows this session."""

    report: str

    @property
    def kinds(self) -> Collection[str]:
        """The types of messages that are steps."""

    def take(self, message: Mapping[str, Any]) -> None:
        """Follow such a message. Raises PageError, InputError."""

    def show(self, plan: Plan) -> int:
        """Note the plan that the page shows from now on; returns its number."""

    def state(self, n: int) -> PageMessage:
        """An answer with the steps' state, for a page that comes."""

    def left(self) -> None:
        """Note that the page is gone, or another one came."""

    def close(self) -> str:
        """End all conversations; returns words on the vehicles of an upload that was broken off, else nothing."""


StepsMaker = Callable[[Edits, SendAnswer, Callable[[], Units]], StepTaker]


class _Enough(Exception):
    """A live plan has its path."""


class MapSession:
    """The state behind one page. ``steps`` makes what takes its steps to files and vehicles."""

    def __init__(self, edits: Edits, units: Units, steps: StepsMaker, base: PageMessage | None = None) -> None:
        self._edits, self._units, self._base = edits, units, base
        self._send: SendAnswer = lambda answer: None
        self.shelf = Shelf()
        self._dropped = DroppedFile(edits, self.shelf)
        self._waiting: queue.SimpleQueue[PageMessage | None] = queue.SimpleQueue()
        self._held: PageMessage | None = None
        self._count = 0
        self._n = 0
        self._planning_live: bool | None = None
        self._begun_s, self._patience_s = 0.0, LIVE_S
        self._followed = False  # a path of the drag was shown
        self._owed = False
        self._homeless: tuple[int, Plan] | None = None  # a plan, with its n, whose way home is to be sent
        self._homes: dict[str, tuple[tuple[object, ...], Verdict, WayHome]] = {}
        self._costs: dict[str, float] = {}
        self._problems: tuple[Mistake, ...] = ()
        self._zones, self._drawn = KeptWorld(), DrawnZones()
        self._names: list[str] = []
        self._vehicle = 0
        self._last: Plan | None = None
        self._shows_scene = False
        self._revision = 0
        self._tiles: GroundTiles | None = None
        self._older: dict[int, GroundTiles | None] = {}  # of the revision before, which a page may still request
        self._tiles_of: Any = None
        self._disk = edits.store.disk()
        self._unkept = False
        self._failed_to_keep = ""
        self.steps = steps(edits, lambda answer: self._send(answer), lambda: self._units)
        self._thread = threading.Thread(target=self._run, name="map session", daemon=True)
        self._thread.start()

    # -- from the server's thread --------------------------------------------------------------------------------

    def attach(self, send: SendAnswer) -> None:
        """Send all answers there from now on."""
        self.steps.left()
        self._send = send

    def hand_in(self, message: PageMessage) -> None:
        """Take a message of the page, in order. Raises PageError if too many wait."""
        if self._waiting.qsize() >= MOST_MESSAGES_WAITING:
            raise PageError("too many messages wait", code="bad_message")
        self._waiting.put(message)
        self.hurry()

    def hurry(self) -> None:
        """End the plan that a waiting message supersedes: at once, but a live one has `LIVE_S` for its path."""
        live, planner = self._planning_live, self._edits.planner
        if planner is None or live is None or self._waiting.empty():
            return
        if not live or time.monotonic() - self._begun_s > self._patience_s:
            planner.cancel()

    def tile(self, revision: int, z: int, x: int, y: int) -> bytes | None:
        """A terrain tile; None if there is none, or other terrains by now."""
        tiles = self._tiles_of_revision(revision)
        return None if tiles is None else tiles.png(z, x, y)

    def contours(self, revision: int, z: int, x: int, y: int) -> bytes | None:
        """The contours of a terrain tile as GeoJSON, in the page's units; None as for `tile`."""
        tiles = self._tiles_of_revision(revision)
        return None if tiles is None else tiles.contours(z, x, y, self._units.height)

    def _tiles_of_revision(self, revision: int) -> GroundTiles | None:
        return self._older.get(revision, self._tiles if revision == self._revision else None)

    def close(self) -> Path | None:
        """End the session; the file in which unsaved edits are kept, None if all are saved. Raises InputError."""
        self._waiting.put(None)
        if self._edits.planner is not None:
            self._edits.planner.cancel()
        self._thread.join()
        self.steps.close()
        return self._edits.store.edits if self._edits.keep() else None

    # -- the session's thread ------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            try:
                message = self._next(IDLE_S)
            except queue.Empty:
                self._look_around()
                continue
            if message is None:
                return
            self._answer(message)

    def _next(self, wait_s: float) -> PageMessage | None:
        """The next message; of live ones that wait in a row, the last with the changes of all."""
        if self._held is not None:
            message, self._held = self._held, None
        else:
            found = self._waiting.get(timeout=wait_s)
            if found is None:
                return None
            message = found
        while _is_live(message):
            try:
                after = self._waiting.get_nowait()
            except queue.Empty:
                break
            if after is None or not _is_live(after):
                if after is None:
                    self._waiting.put(None)
                else:
                    self._held = after
                break
            message = after | {"changes": {**message["changes"], **after["changes"]}}
        return message

    @property
    def _superseded(self) -> bool:
        return self._held is not None or not self._waiting.empty()

    def _answer(self, message: PageMessage) -> None:
        self._n = message["n"]
        try:
            plans = self._do(message)
        except PageError as why:
            self._send(answers.error_answer(self._n, why, why.code))
            plans = False
        except GcsplanError as why:
            self._problems = why.problems if isinstance(why, InputError) else ()
            self._send(answers.error_answer(self._n, why, "bad_mission"))
            self._send_state()
            plans = False
        except Exception as why:  # the page must hear of a bug, and the session goes on
            self._send(answers.error_answer(self._n, GcsplanError(f"a bug of gcsplan: {why!r}"), "internal"))
            plans = False
        if (plans or self._owed) and self._edits.planner is not None:
            self._homeless = None
            self._plan(live=_is_live(message))
        else:
            self._send_home()

    def _do(self, message: PageMessage) -> bool:
        """Follow a message; whether a plan follows. Raises PageError, InputError."""
        edits, kind = self._edits, message["type"]
        if kind == "change":
            live = _is_live(message)
            edits.change(changes_of(message), live=live)
            if live:
                return True
            self._unkept = True
        elif kind == "save":
            file = edits.save(message.get("name"), over=message.get("over") is True)
            self._disk = edits.store.disk()
            self._unkept = True  # the steps of undo are those of another text now
            self._send({"type": "saved", "n": self._n, "file": file.name})
            self._send_state()
            return False
        elif kind in ANSWERED_BY or kind in SHOWN or kind in self.steps.kinds:
            self._show(message)
            return False
        elif kind == "set_text":
            try:
                edits.write(message.get("text"))
            except InputError as why:
                code = why.code if isinstance(why, PageError) else "bad_text"
                self._send(answers.error_answer(self._n, why, code))
                return False
            self._unkept = True
        elif kind == "take":
            self._dropped.take(message)
            self._zones, self._tiles_of = KeptWorld(), None  # a file may have been replaced
            self._unkept = True
        elif kind == "arrange":
            edits.make(arranged(edits.document, message))
            self._unkept = True
        elif kind == "units":
            name = message.get("units")
            if not isinstance(name, str) or name not in SYSTEMS:
                raise PageError(f"units are {', '.join(SYSTEMS)}", code="bad_message", where="units")
            self._units = SYSTEMS[name]
        elif kind in ("new", "undo", "redo", "cancel", "reload"):
            if kind == "new":
                edits.begin(message)
            else:
                getattr(edits, kind)()
            self._disk = edits.store.disk()
            self._unkept = True
        elif kind == "hello":
            edits.cancel()  # a page that comes again has dropped what it dragged
            self._shows_scene = False
            self._send(self.steps.state(self._n))
        else:
            raise PageError("this type of message is not known", code="bad_message", where="type")
        self._problems = ()
        self._send_state()
        return True

    def _show(self, message: PageMessage) -> None:
        """Follow a message that changes no mission. Raises PageError, InputError."""
        kind = message["type"]
        if kind in ANSWERED_BY:
            self._send({"type": ANSWERED_BY[kind], "n": self._n, **self._answer_to(message)})
        elif kind == "vehicle":
            self._vehicle = _number(message.get("vehicle"))
            self._send_state()
            profile = None if self._last is None else answers.profile_answer(self._n, self._last, self._vehicle)
            if profile is not None:
                self._send(profile)
        elif kind == "scene":
            self._shows_scene = message.get("on") is True
            self._send_scene()
        else:
            self.steps.take(message)

    def _answer_to(self, message: PageMessage) -> PageMessage:
        """The answer to a message that changes nothing: a form, the text, the dropped file. Raises PageError."""
        match message["type"]:
            case "section":
                return section_form(message.get("section"), self._edits.document, self._problems)
            case "place":
                return {"at": read_text(message.get("text"))}
            case "text":
                return {"text": self._edits.text}
        with cancelled_by(lambda: self._superseded):
            return self._dropped.look(message, self._units)

    def _look_around(self) -> None:
        """While nothing else happens: keep unsaved edits, and look whether the file changed."""
        if self._unkept:
            self._unkept = False
            try:
                self._edits.keep()
            except InputError as why:
                if str(why) != self._failed_to_keep:
                    self._failed_to_keep = str(why)
                    self._send(answers.error_answer(self._n, why, "not_saved"))
        disk = self._edits.store.disk()
        if disk != self._disk:
            self._disk = disk
            self._send_state()

    # -- plans ---------------------------------------------------------------------------------------------------

    def _plan(self, *, live: bool) -> None:
        edits, planner, n = self._edits, self._edits.planner, self._n
        assert planner is not None
        self._costs.clear()
        if not live:
            self._last = None
        self._begun_s = time.monotonic()
        begun_s = time.perf_counter()
        seen: set[str] = set()
        names, alone = self._names, self._moved_alone() if live else None
        paths = len(names) if alone is None else 1

        def on_path(found: BetterPath) -> None:
            if live and found.vehicle in seen:
                return
            first = found.vehicle not in seen
            seen.add(found.vehicle)
            self._costs[found.vehicle] = found.cost
            self._send(answers.path_answer(n, names.index(found.vehicle), found, live=live, first=first))
            if live and len(seen) == paths:
                raise _Enough

        def on_bound(vehicle: str, bound: float) -> None:
            if not live:
                cost = self._costs.get(vehicle)
                self._send(answers.bound_answer(n, names.index(vehicle), bound, cost))

        self._planning_live, self._owed = live, not live
        try:
            if self._held is not None or (self._superseded and not live):
                return  # a message waits behind the drag, or what is owed comes after it
            hears = None if not live and self._judge_dragged(n, planner) else on_path
            changes = dict(edits.live) if live else None
            plan = planner.plan(changes, on_path=hears, on_bound=on_bound, alone=alone, draft=live)
            self._planning_live = None
            if live:
                for v in plan.vehicles:  # of a planner that tells no progress
                    on_path(path_of(v, plan.world, time.perf_counter() - begun_s))
                return
            self._last = plan
            self._send_plan(n, plan, time.perf_counter() - begun_s)
            self._owed = False
        except _Enough:
            self._followed = True
            self._patience_s = min(max(LIVE_S, 3.0 * (time.monotonic() - self._begun_s)), LIVE_MOST_S)
        except Cancelled:
            self._patience_s = min(2.0 * self._patience_s, LIVE_MOST_S)
        except NoMission as why:
            self._owed = False
            self._send(answers.refused_answer(n, why, planner.mission, self._units, live=live))
        except InputError as why:
            self._owed = False
            self._send_mistakes(n, why, live=live)
        except Exception as why:  # the page must hear of a bug, and the session goes on
            self._owed = False
            self._send(answers.error_answer(n, GcsplanError(f"a bug of gcsplan: {why!r}"), "internal"))
        finally:
            self._planning_live = None

    def _send_mistakes(self, n: int, why: InputError, *, live: bool) -> None:
        """Send what is wrong with the mission; unless it is only dragged, the state with each mistake at its field."""
        if not live:
            self._problems = why.problems
            self._send_state()
        self._send(answers.error_answer(n, why, "bad_mission"))

    def _judge_dragged(self, n: int, planner: Planner) -> bool:
        """Send the verdict on the only vehicle's path as it was dragged, without its way home, if it is safe: it stands
        while the search goes on, whose bounds make its gap smaller. Returns whether it was sent. Raises Cancelled."""
        begun_s = time.perf_counter()
        followed, self._followed = self._followed, False
        if not followed or len(self._names) != 1:
            return False
        with suppress(NoMission, InputError):  # the search that follows has the words
            plan = planner.plan(DRAGGED_ALONE, draft=True)
            [v] = plan.vehicles
            if v.verdict.safe is True:
                self._costs[v.name] = v.cost
                answer = answers.plan_answer(n, plan, {}, self._units, time.perf_counter() - begun_s)
                self._send(answer | {"type": "interim", "verdict": answers.verdict_word(True)})
                return True
        return False

    def _send_plan(self, n: int, plan: Plan, elapsed_s: float) -> None:
        """Send the certificate, then the way home, which is judged before it if the mission requires a safe one."""
        required = is_required(plan.source, option=False)
        homes = homes_of(plan) if required else {}
        answer = answers.plan_answer(n, plan, homes, self._units, elapsed_s, self._vehicle)
        self._send(answer | {"plan": self.steps.show(plan)})
        self._send_scene()
        self._homeless = None if required else (n, plan)
        self._send_home()

    def _send_home(self) -> None:
        """Send the way home of the newest plan, unless it was sent or a message waits."""
        if self._homeless is None:
            return
        n, plan = self._homeless
        with suppress(Cancelled), cancelled_by(lambda: self._superseded):
            found = {v.name: self._home_of(v, plan) for v in plan.vehicles}
            self._homes = {name: self._homes[name] for name in found}
            self._homeless = None
            self._send(answers.home_answer(n, plan, found, self._units))

    def _home_of(self, v: VehiclePlan, plan: Plan) -> WayHome:
        """The way home of a vehicle; the one before if its mission and what it flies over are the same."""
        air, error_m = plan.world.airspace, plan.source.terrain_error_m
        made_of = (id(v.verdict), v.request, air.surface, air.zones, error_m)
        known = self._homes.get(v.name)
        if known is None or known[0] != made_of:
            home = home_of(v.verdict, v.request, plan.world, error_m)
            known = self._homes[v.name] = (made_of, v.verdict, home)  # the verdict stays, so its id is its own
        return known[2]

    def _send_scene(self) -> None:
        """Send the plan in space, if the page shows it."""
        if self._shows_scene and self._last is not None and not self._superseded:
            self._send(scene_answer(self._n, self._last, self._units))

    def _moved_alone(self) -> str | None:
        """The name of the only vehicle that the drag moves; None if it moves several, or a zone."""
        moved = {found[1] if (found := _PLACE_OF.match(place)) else "" for place in self._edits.live}
        number = next(iter(moved), "")
        return self._names[int(number)] if len(moved) == 1 and number and int(number) < len(self._names) else None

    # -- the state -----------------------------------------------------------------------------------------------

    def _send_state(self) -> None:
        self._send(self.state())

    def state(self) -> PageMessage:
        """The page's whole state."""
        edits = self._edits
        document = edits.document
        frame = _frame_of(document)
        self._find_tiles(document, frame)
        vehicles = vehicles_of(document, frame)
        if self._names and len(vehicles) == len(self._names) + 1:
            self._vehicle = len(vehicles) - 1  # a new vehicle is the chosen one
        self._names = [v["name"] for v in vehicles]
        self._vehicle = min(self._vehicle, max(len(vehicles) - 1, 0))
        where = str(edits.store.place)
        entries: dict[str, Any] = {}
        with suppress(InputError):
            entries = dict(zones_by_entry(Content(edits.store.place, where, document, None), self._zones))
        file = edits.store.file
        return {
            "type": "state", "n": self._n, "stage": edits.stage, "name": str(document.get("name", "")),
            "file": None if file is None else file.name, "saved": edits.is_saved, "disk": self._disk,
            "restored": edits.restored, "undo": edits.can_undo, "redo": edits.can_redo,
            "files": terrain_choices(edits.store.folder), "drops": endings(), "grounds": list(GROUND_ENDINGS),
            "base": self._base,
            "units": {"name": self._units.name, "systems": list(SYSTEMS), "kinds": self._units.as_dict()},
            "bounds": _bounds_of(vehicles) or (self._tiles.bounds if self._tiles is not None else None),
            "terrain": self._terrain(), "vehicles": vehicles, "vehicle": self._vehicle, "arrival": arrival_of(document),
            "zones": self._drawn.geojson(document, entries, frame, self._units),
            "counts": {key: len(document.get(key) or ()) for key in ("no_fly", "keep_in")},
            "form": short_form(document, self._problems, self._vehicle) if edits.stage == "mission" else [],
            "problems": [{"where": p.key, "message": p.message} for p in self._problems],
        }  # fmt: skip

    def _find_tiles(self, document: EditedDocument, frame: Frame | None) -> None:
        """Open the terrain for tiles where it is another one than before."""
        section = document.get("terrain")
        named = section, None if frame is None else (frame.lat_deg, frame.lon_deg)
        if named == self._tiles_of:
            return
        self._older = {self._revision: self._tiles}
        self._revision += 1
        self._tiles_of = named
        self._tiles = None
        if section is not None:
            with suppress(InputError):  # what is wrong with the terrain, the plan says
                self._tiles = GroundTiles(section, self._edits.store.folder, frame)

    def _terrain(self) -> PageMessage | None:
        tiles = self._tiles
        if tiles is None:
            return None
        return {
            "tiles": f"terrain/{self._revision}/{{z}}/{{x}}/{{y}}.png", "bounds": tiles.bounds, "minzoom": LEAST_ZOOM,
            "maxzoom": MOST_ZOOM, "flat": tiles.flat,
            "contours": f"contours/{self._revision}/{self._units.name}/{{z}}/{{x}}/{{y}}.json",
            "contours_m": [contour_interval_m(zoom, self._units.height) for zoom in range(MOST_ZOOM + 1)],
        }  # fmt: skip


def _number(value: object) -> int:
    """The number of a vehicle. Raises PageError."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < MOST_VEHICLES_OF_FILE:
        raise PageError("vehicle is the number of a vehicle, from 0", code="bad_message", where="vehicle")
    return value


def _is_live(message: Mapping[str, Any]) -> bool:
    return message.get("live") is True and message["type"] == "change" and isinstance(message.get("changes"), dict)


def _frame_of(document: EditedDocument) -> Frame | None:
    """The frame of a mission in local metres; None for one in degrees."""
    given = document.get("frame")
    if not isinstance(given, dict):
        return None
    try:
        lat, lon = given["origin"]
        return Frame(float(lat), float(lon))
    except (KeyError, TypeError, ValueError, InputError):
        return None


def _bounds_of(vehicles: list[PageMessage]) -> list[float] | None:
    """West, south, east, north around all places of the vehicles."""
    places = [p for v in vehicles for p in (v["start"], v["goal"], *v["via"]) if p is not None]
    if not places:
        return None
    lat, lon = [p[0] for p in places], [p[1] for p in places]
    return [min(lon) - SPARE_DEG, min(lat) - SPARE_DEG, max(lon) + SPARE_DEG, max(lat) + SPARE_DEG]
