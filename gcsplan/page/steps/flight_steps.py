"""`PageSteps`: write, look, upload, connect: the steps that leave the page, each with the plan that it shows.

An upload needs a look before it, which gives the page a ticket: a random text that is valid once, for a while, for this
plan, these links and permissions, and for the page that looked. The same goes to vehicles as from the command line, by
the same refusals (`app/output/handout.py`, `app/upload/run.py`).
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcsplan.app.fleet import pipeline
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.output import files as outputs
from gcsplan.app.output.handout import Handout, handout
from gcsplan.app.plan.earlier import last_plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.job import SIM, UploadOptions, broken_off
from gcsplan.errors import Cancelled, CheckFailed, GcsplanError, InputError, NoMission
from gcsplan.export.outdir import add_output, outputs_in, retire_outputs, settle_outputs, write_outputs
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mission_file.kept import KeptWorld
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.request import MissionFile
from gcsplan.notes.note import Wording
from gcsplan.page.edits import Edits
from gcsplan.page.fleet.time_table import numbers_of, release_table
from gcsplan.page.map_session import PageMessage
from gcsplan.page.refused import PageError
from gcsplan.page.steps.vehicle_desk import VehicleDesk
from gcsplan.units import Units

if TYPE_CHECKING:
    from gcsplan.mavlink.link.options import WindJudge
    from gcsplan.mavlink.link.watch import VehicleState
    from gcsplan.mavlink.protocol.machine import TransferProgress

STEP_KINDS = frozenset({"write", "look", "upload", "stop", "connect", "disconnect", "on_board"})
"""The types of messages that are steps."""

TICKET_BYTES, TICKET_S = 18, 180.0
"""Random bytes of a ticket, and for how long it is valid."""

MOST_WHERE, MOST_TARGETS = 4000, 200
"""Most characters, and most words, that say where vehicles are."""

NO_PLACE_OF_SIM = "simulated vehicles stand where a plan begins, and there is none yet: give a start and a goal"

PROGRESS_S, HEARD_S = 0.1, 10.0
PERMISSIONS = ("allow_armed", "ignore_position", "allow_parameters", "atomic")
LISTS = ("fence", "rally", "fence_infinite")


@dataclass(frozen=True, eq=False)
class ShownPlan:
    """A plan with the number under which the page knows it.

    ``folder`` is for its outputs; ``saved``: the mission file holds it. Both are as they were when a step began.
    """

    number: int
    plan: Plan
    folder: Path = Path()
    saved: bool = False

    def for_step(self, edits: Edits, number: object) -> ShownPlan:
        """The plan as a step takes it. Raises PageError unless ``number`` names this plan, and neither edits nor files
        have changed since."""
        if number != self.number or isinstance(number, bool):
            raise _refused("the mission was planned anew since: look at the new plan first")
        content = self.plan.source.content
        planner = edits.planner
        if edits.live or content is None or planner is None or planner.mission != content.given:
            raise _refused("the mission was changed since it was planned: wait for the new plan")
        if edits.store.disk() in ("changed", "gone"):
            name = edits.store.place.name
            raise _refused(f"{name} was changed on the disk: take the file, or save over it")
        try:
            now = load_content(content, KeptWorld())
        except InputError as why:
            raise _refused(f"the mission's files were changed on the disk: {why.message}") from None
        if _sums(now) != _sums(self.plan.source):
            raise _refused("the terrain, the zones or the wind were changed on the disk: take the file again")
        store = edits.store
        return replace(self, folder=store.folder / store.place.stem, saved=store.file is not None and edits.is_saved)


@dataclass(frozen=True, eq=False)
class _Ticket:
    text: str
    shown: ShownPlan
    handed: Handout
    options: UploadOptions
    until_s: float
    page: int


class PageSteps:
    """The steps of one page. ``send`` takes answers, from any thread; `take` and `show` are for the session's thread.

    ``report`` is the newest ``report.html`` that was written, for the server to show.
    """

    def __init__(self, edits: Edits, send: Callable[[PageMessage], None], units: Callable[[], Units]) -> None:
        self._edits, self._send, self._units = edits, send, units
        self._shown: ShownPlan | None = None
        self._number = self._page = self._connection = 0
        self._ticket: _Ticket | None = None
        self._where, self._strangers = "", False
        self._live: dict[str, PageMessage] = {}
        self._heard_s: dict[str, float] = {}
        self._live_sent_s = 0.0
        self._winds: tuple[ShownPlan | None, dict[str, WindJudge]] = (None, {})
        self._last: PageMessage | None = None
        self.report = ""
        self._desk = VehicleDesk(send, self._lost)

    @property
    def kinds(self) -> frozenset[str]:
        """The types of messages that are steps."""
        return STEP_KINDS

    def show(self, plan: Plan) -> int:
        """The plan that the page shows from now on; its number."""
        self._number += 1
        self._shown, self._ticket = ShownPlan(self._number, plan), None
        if self._strangers:  # who is heard has a name now
            with suppress(PageError):
                self._connect({"to": self._where, "n": 0})
        return self._number

    def left(self) -> None:
        """The page is gone, or another one came: its upload ends as a command does whose terminal is closed."""
        self._page += 1
        self._ticket = None
        self._desk.stop()

    def close(self) -> str:
        """End all conversations; returns words on the vehicles of an upload that was broken off, else nothing."""
        self._desk.close()
        last = self._last or {}
        return str(last["message"]) if last.get("code") == Cancelled.exit_code else ""

    def state(self, n: int) -> PageMessage:
        """What a page that comes, or comes again, has to know."""
        return {"type": "steps", "n": n, "where": self._where, "busy": self._desk.busy, "last": self._last}

    def take(self, message: Mapping[str, Any]) -> None:
        """Follow a message of one of `STEP_KINDS`. Raises PageError, InputError."""
        kind, n = message["type"], message["n"]
        if kind == "stop":
            self._desk.stop()
        elif kind == "disconnect":
            self._where, self._live, self._heard_s, self._strangers = "", {}, {}, False
            self._desk.listen(None)
            self._send(self.state(n))
        elif kind == "connect":
            self._connect(message)
        elif kind == "upload":
            self._upload(message)
        else:
            shown = self._require_shown(message)
            if kind == "write":
                lists, unjudged = _lists(message), _flag(message, "allow_unjudged")
                self._do(n, "written", lambda: self._write(n, shown, lists, allow_unjudged=unjudged))
                return
            targets = _targets(message, shown.plan.source, shown.plan)
            if kind == "on_board":
                self._do(n, kind, lambda: self._on_board(n, shown, targets))
                return
            options = UploadOptions(**{key: _flag(message, key) for key in PERMISSIONS})
            lists, unjudged, page = _lists(message), _flag(message, "allow_unjudged"), self._page
            gate, self._ticket = _gate(message), None
            self._do(n, "looked", lambda: self._look(n, shown, targets, options, lists, page, unjudged, gate))

    def _require_shown(self, message: Mapping[str, Any]) -> ShownPlan:
        if self._desk.busy:  # before the files are read again, which takes long
            raise PageError("another step is under way: wait for its end, or stop it", code="not_sent")
        if self._shown is None:
            raise PageError("there is no plan: nothing was sent or written", code="not_sent")
        return self._shown.for_step(self._edits, message.get("plan"))

    def _do(self, n: int, kind: str, task: Callable[[], PageMessage]) -> None:
        """Let the desk do a task next, whose error is an answer of this kind. Raises PageError if it has one."""

        def done() -> PageMessage:
            try:
                answer = task()
            except GcsplanError as why:
                answer = _failed(kind, n, why)
            except Exception as why:  # a bug must not end the desk
                answer = _failed(kind, n, GcsplanError(f"a bug of gcsplan: {why!r}"))
            self._last = answer if kind == "uploaded" else self._last
            return answer

        if not self._desk.do(done):
            raise PageError("another step has begun meanwhile: wait for its end", code="not_sent")

    # -- write ---------------------------------------------------------------------------------------------------

    def _handed(
        self,
        shown: ShownPlan,
        targets: Mapping[str, str],
        lists: tuple[bool, bool, bool],
        *,
        allow_unjudged: bool,
        gate: GateTime | None = None,
    ) -> Handout:
        """What the command line hands out with ``--report``. Raises GcsplanError; earlier outputs are retired then.

        With ``gate`` the mission is planned again, as the command line does: its vehicles wait for their seconds.
        """
        plan = shown.plan if gate is None else pipeline.plan(shown.plan.source, gate_utc=gate.start)
        directory = shown.folder
        settle_outputs(directory)
        earlier = [last_plan(plan.source, directory)[0]] if outputs_in(directory) else []
        try:
            return handout(plan, targets, lists, earlier, allow_unjudged=allow_unjudged, home=True)
        except (CheckFailed, NoMission, InputError) as why:
            with suppress(InputError):
                if retire_outputs(directory):
                    why.message += f"; earlier outputs in {directory} were moved to its folder `previous`"
            raise

    def _write(self, n: int, shown: ShownPlan, lists: tuple[bool, bool, bool], *, allow_unjudged: bool) -> PageMessage:
        return self._written(n, shown.folder, self._handed(shown, {}, lists, allow_unjudged=allow_unjudged))

    def _written(self, n: int, folder: Path, handed: Handout) -> PageMessage:
        """Write all outputs, whole or not at all. Raises InputError."""
        files = handed.files(self._units())
        moved = write_outputs(folder, files)
        self.report = files["report.html"]
        wording = Wording(self._units())
        notes = [f"{name}: {note.text(wording)}" for name, note in handed.notes]
        notes += [f"{name} was not gcsplan's, and was moved to previous" for name in moved]
        return {"type": "written", "n": n, "code": 0, "message": "", "folder": str(folder),
                "files": sorted(files), "notes": notes}  # fmt: skip

    # -- look and upload -----------------------------------------------------------------------------------------

    def _look(
        self, n: int, shown: ShownPlan, targets: Mapping[str, str], options: UploadOptions,
        lists: tuple[bool, bool, bool], page: int, allow_unjudged: bool, gate: GateTime | None,
    ) -> PageMessage:  # fmt: skip
        from gcsplan.page.steps.words import look_of

        handed = self._handed(shown, targets, lists, allow_unjudged=allow_unjudged, gate=gate)
        seen = uploads.look(handed.jobs, options, simulator=self._desk.simulator)
        vehicles = [look_of(handed, job, seen[job.name], self._units()) for job in handed.jobs]
        may_go = any(v["found"] and not v["against"] for v in vehicles)
        ticket = secrets.token_urlsafe(TICKET_BYTES) if may_go and page == self._page else ""
        if ticket:
            self._ticket = _Ticket(ticket, shown, handed, options, time.monotonic() + TICKET_S, page)
        wording = Wording(self._units())
        notes = [f"{name}: {note.text(wording)}" for name, note in handed.notes]
        notes += [f"{left.name} is left out: {left.message}" for left in handed.plan.left_out]
        notes += [] if shown.saved else ["the edits are not saved: the mission file does not have what is sent"]
        return {"type": "looked", "n": n, "code": 0, "message": "", "plan": shown.number, "ticket": ticket,
                "vehicles": vehicles, "notes": notes, "folder": str(shown.folder),
                "release": release_table(handed.plan, ())}  # fmt: skip

    def _upload(self, message: Mapping[str, Any]) -> None:
        """Send what a look has shown. Raises PageError without its ticket."""
        given, ticket, self._ticket = message.get("ticket"), self._ticket, None
        if ticket is None or not isinstance(given, str) or not _same(given, ticket.text):
            raise PageError("nothing was sent: look at the vehicles first", code="not_sent")
        if time.monotonic() > ticket.until_s or ticket.page != self._page:
            raise PageError("nothing was sent: the look at the vehicles is too old, look again", code="not_sent")
        shown = self._require_shown(message)
        if shown.number != ticket.shown.number:
            raise PageError("nothing was sent: the mission was planned anew since the look", code="not_sent")
        n, self._last = message["n"], None
        self._do(n, "uploaded", lambda: self._sent(n, ticket))

    def _sent(self, n: int, ticket: _Ticket) -> PageMessage:
        handed, names = ticket.handed, [job.name for job in ticket.handed.jobs]
        folder = ticket.shown.folder
        GateTime.require_of(handed.plan)
        self._send(self._written(n, folder, handed))
        progress = _Progress(n, self._send)
        try:
            results = uploads.run_jobs(handed.jobs, ticket.options, progress, simulator=self._desk.simulator)
        except Cancelled as why:
            raise Cancelled(broken_off(names), reason=why.reason) from None
        from gcsplan.page.steps.words import result_of

        noted = ""
        try:
            add_output(folder, "upload.json", outputs.upload_text(handed.plan, results, handed.homes))
            self.report = handed.report(results, self._units())
            add_output(folder, "report.html", self.report)
        except InputError as why:
            noted = f"the result of the upload is not written: {why}"
        failure = uploads.failure(results) or {"code": 0, "reason": "", "message": ""}
        return {
            "type": "uploaded", "n": n, "code": failure["code"], "reason": failure["reason"],
            "message": failure["message"], "vehicles": [result_of(r, self._units()) for r in results],
            "notes": [noted] if noted else [], "release": release_table(handed.plan, results),
        }  # fmt: skip

    # -- vehicles ------------------------------------------------------------------------------------------------

    def _on_board(self, n: int, shown: ShownPlan, targets: Mapping[str, str]) -> PageMessage:
        from gcsplan.page.steps.words import on_board_of

        plan, numbers, vehicles = shown.plan, numbers_of(shown.plan), []
        with self._addresses(plan, targets) as where:
            missions = uploads.on_board(plan.source, where)
        for v in plan.vehicles:
            if v.name in missions:
                board = on_board_of(plan, v, missions[v.name], self._units())
                vehicles.append({"name": v.name, "vehicle": numbers[v.name], **board})
        return {"type": "on_board", "n": n, "code": 0, "message": "", "vehicles": vehicles}

    @contextmanager
    def _addresses(self, plan: Plan, targets: Mapping[str, str]) -> Iterator[dict[str, str]]:
        """The URLs of vehicles, with the simulator's for simulated ones."""
        missions = [v.mission for v in plan.vehicles if targets.get(v.name) == SIM]
        with self._desk.simulator(missions) if missions else nullcontext("") as url:
            yield {name: url if to == SIM else to for name, to in targets.items()}

    def _connect(self, message: Mapping[str, Any]) -> None:
        """Listen to the vehicles of the mission; before there is one, to all that are heard. Raises PageError."""
        shown, source = (None, None) if self._edits.planner is None else (self._shown, self._source())
        if source is None:
            targets, sysids = {"": _stranger_at(message)}, {"": 0}
        else:
            targets = _targets(message, source, None if shown is None else shown.plan)
            sysids = {request.vehicle.name: request.vehicle.sysid for request in source.vehicles}
        if shown is None and SIM in targets.values():
            raise PageError(NO_PLACE_OF_SIM, code="not_sent", where="to")
        numbers = {} if source is None else {name: k for k, name in enumerate(sysids)}
        self._where, self._live, self._heard_s = str(message["to"]), {}, {}
        self._strangers = source is None
        self._connection += 1
        connection = self._connection

        def listen() -> None:
            from gcsplan.page.steps.live_vehicles import listen_to

            with nullcontext(targets) if shown is None else self._addresses(shown.plan, targets) as where:
                seats = {name: (url, sysids[name]) for name, url in where.items()}

                def reported(name: str, state: VehicleState | None, age_s: float) -> None:
                    if connection == self._connection:
                        number, url = numbers.get(name, -1), targets.get(name) or targets[""]
                        self._reported(name, number, url, state, age_s)

                listen_to(seats, reported)

        self._desk.listen(listen)
        self._send(self.state(message["n"]))

    def _source(self) -> MissionFile | None:
        """The mission whose vehicles are known; None as long as it cannot be read."""
        if self._shown is not None or self._edits.planner is None:
            return None if self._shown is None else self._shown.plan.source
        with suppress(InputError):
            return self._edits.planner.loaded()
        return None

    def _reported(self, name: str, number: int, url: str, state: VehicleState | None, age_s: float) -> None:
        """Send what the vehicles report, all of them at once."""
        from gcsplan.page.steps.live_vehicles import REPORT_S
        from gcsplan.page.steps.words import live_of

        now_s = time.monotonic()
        if state is None and now_s - self._heard_s.get(name, -math.inf) < HEARD_S:
            return  # it was heard before a step that had the link, and is in a moment
        if state is not None:
            self._heard_s[name] = now_s
        beside = None
        if state is not None and state.wind is not None and (wind := self._wind_of(name)) is not None:
            beside = wind(state)
        self._live[name] = live_of(name, number, url, state, age_s, beside, self._units())
        if now_s - self._live_sent_s >= REPORT_S:
            self._live_sent_s = now_s
            self._send({"type": "live", "n": 0, "vehicles": list(self._live.values())})

    def _wind_of(self, name: str) -> WindJudge | None:
        from gcsplan.app.upload.wind_on_board import wind_judge

        shown = self._shown
        if shown is not None and self._winds[0] is not shown:
            jobs = uploads.jobs_of(shown.plan, {v.name: "" for v in shown.plan.vehicles})
            made = {job.name: judge for job in jobs if (judge := wind_judge(job)) is not None}
            self._winds = shown, made
        return self._winds[1].get(name)

    def _lost(self, why: GcsplanError) -> None:
        """Listening has ended by itself."""
        self._where, self._live, self._strangers = "", {}, False
        self._send({"type": "error", "n": 0, "code": "not_sent", "message": f"not connected: {why}", "where": "to"})
        self._send(self.state(0))


class _Progress:
    """Sends the progress of an upload, each vehicle's at most every `PROGRESS_S`, and every change of its phase."""

    def __init__(self, n: int, send: Callable[[PageMessage], None]) -> None:
        self._n, self._send = n, send
        self._sent: dict[str, tuple[float, str]] = {}

    def __call__(self, name: str, at: TransferProgress) -> None:
        now_s = time.monotonic()
        before_s, phase = self._sent.get(name, (0.0, ""))
        if at.failed is None and phase == at.phase and now_s - before_s < PROGRESS_S:
            return
        self._sent[name] = now_s, at.phase
        self._send({"type": "progress", "n": self._n, "name": name, "phase": at.phase, "done": at.done,
                    "total": at.total, "failed": at.failed})  # fmt: skip


def _failed(kind: str, n: int, why: GcsplanError) -> PageMessage:
    """The answer of a step that did not come to its end: the exit code and the words of the command line."""
    return {"type": kind, "n": n, "code": why.exit_code, "reason": why.reason, "message": str(why), "vehicles": [],
            "notes": []}  # fmt: skip


def _same(given: str, text: str) -> bool:
    return secrets.compare_digest(given.encode("utf-8", "replace"), text.encode())


def _flag(message: Mapping[str, Any], key: str) -> bool:
    value = message.get(key, False)
    if not isinstance(value, bool):
        raise PageError("give true or false", code="bad_message", where=key)
    return value


def _lists(message: Mapping[str, Any]) -> tuple[bool, bool, bool]:
    fence, rally, infinite = (_flag(message, key) for key in LISTS)
    return fence, rally, infinite


def _gate(message: Mapping[str, Any]) -> GateTime | None:
    """The common start, as ``--gate-utc`` reads it; None if there is none. Raises PageError."""
    given = message.get("gate_utc") or ""
    if not isinstance(given, str) or len(given) > MOST_WHERE:
        raise PageError("a common start is a text such as 18:30:00", code="bad_message", where="gate_utc")
    try:
        return GateTime.parse(given.strip(), datetime.now(UTC)) if given.strip() else None
    except GcsplanError as why:
        raise PageError(f"nothing was sent: {why.message}", code="not_sent", where="gate_utc") from None


def _targets(message: Mapping[str, Any], source: MissionFile, plan: Plan | None) -> dict[str, str]:
    """Vehicle name to URL, as ``--upload`` reads what the user typed; with a plan, for the vehicles that fly.

    Raises PageError.
    """
    words = _words(message)
    try:
        to = uploads.targets(words, [r.vehicle for r in source.vehicles])
    except GcsplanError as why:
        raise PageError(str(why), code="not_sent", where="to") from None
    return to if plan is None else {name: to[name] for v in plan.vehicles if (name := v.name) in to}


def _words(message: Mapping[str, Any]) -> list[str]:
    """What the user typed as places of vehicles. Raises PageError."""
    given = message.get("to")
    if not isinstance(given, str) or not given.strip() or len(given) > MOST_WHERE:
        raise PageError("say where the vehicles are: sim, or a link", code="not_sent", where="to")
    words = given.split()
    if len(words) > MOST_TARGETS:
        raise PageError(f"give at most {MOST_TARGETS} links", code="not_sent", where="to")
    return words


def _stranger_at(message: Mapping[str, Any]) -> str:
    """The one link where all that are heard are shown. Raises PageError."""
    words = _words(message)
    if words == [SIM]:
        raise PageError(NO_PLACE_OF_SIM, code="not_sent", where="to")
    if len(words) != 1:
        raise PageError("give one link: the mission has no vehicles yet", code="not_sent", where="to")
    try:
        return parse_url(words[0]).url
    except InputError as why:
        raise PageError(str(why), code="not_sent", where="to") from None


def _sums(source: MissionFile) -> dict[str, Any]:
    """What identifies the files that a mission was read from."""
    sums: dict[str, Any] = {key: value for key, value in source.inputs.items() if key.endswith("sha256")}
    return sums | {"forecast": [note.data.get("sha256") for note in source.notes if note.code == "wind_of_forecast"]}


def _refused(words: str) -> PageError:
    return PageError(f"nothing was sent or written: {words}", code="not_sent")
