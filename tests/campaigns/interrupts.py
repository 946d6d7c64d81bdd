"""Signals at random moments of commands that write, compute for long, or talk: do they end by the contract?

    python -m tests.campaigns.interrupts --seconds 120 [--seed 1] [--rounds N] [--kinds plan check …]

A site is a folder with a random past and one command; it is run undisturbed first. Each of its rounds runs the command
and sends it SIGINT, SIGTERM or SIGHUP, alone or with its whole group as a terminal does, after a random part of its
time. It must end within `PATIENCE_S` of the processor, with the signal's exit code (or with its own, if it was
done), one message, no traceback, one JSON document, no process left, and files that are all of before or all of after.
Undisturbed, it then must make the same files as at first. Exits with 1, and prints the seed, if any of that fails.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler
from pathlib import Path

from gcsplan.world.terrain.cell import Cell
from tests.campaigns import large_inputs
from tests.campaigns.disk import workshop
from tests.export.test_generation import heed_signals
from tests.support.paths import REPOSITORY
from tests.support.tiles import Served, serving

PATIENCE_S, PATIENCE_BY_CLOCK_S = 2.0, 30.0
"""Seconds of the processor that a command may take after its signal; and of the clock, on a busy machine."""

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
HIDDEN = ".gcsplan-"
"""How names of unfinished files begin. A tile that is half here is called .part, and goes on from there."""

ROUNDS, AGAIN = 12, 0.3
"""Rounds of a site, and part of them after which the command is run again undisturbed."""

Tree = dict[str, bytes]


@dataclass
class Case:
    """A command, the folder that it writes to, and the folder's content before and after it."""

    arguments: list[str]
    folder: Path
    written: str
    """The folder, in ``folder``, whose files are compared; empty if the command writes none."""

    steps: bool = False
    """Whether it may stop between folders of its output, each of which is whole."""

    moving: tuple[str, ...] = ()
    """Names of files with clock readings, which differ each time."""

    environment: dict[str, str] = field(default_factory=dict)
    code: int = 0
    lasts_s: float = 0.0
    before: Tree = field(default_factory=dict)
    after: Tree = field(default_factory=dict)

    def tree(self) -> Tree:
        """The files of the output, but for the ones that differ each time."""
        root = self.folder / self.written
        if not self.written or not root.is_dir():
            return {}
        files = [p for p in sorted(root.rglob("*")) if p.is_file()]
        return {str(p.relative_to(root)): b"" if p.name in self.moving else p.read_bytes() for p in files}

    def put_back(self) -> None:
        """Make the output as it was before."""
        root = self.folder / self.written
        if not self.written:
            return
        shutil.rmtree(root, ignore_errors=True)
        root.mkdir()
        for name, content in self.before.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)

    def start(self) -> subprocess.Popen[bytes]:
        """Start the command, in a session of its own."""
        paths = os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")])
        return subprocess.Popen(
            [sys.executable, "-m", "gcsplan", *self.arguments], cwd=self.folder, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env=os.environ | {"PYTHONPATH": paths} | self.environment,
            preexec_fn=heed_signals, start_new_session=True,
        )  # fmt: skip

    def undisturbed(self) -> tuple[int, float, str]:
        """Exit code, seconds and messages of the command, left alone."""
        begun = time.monotonic()
        process = self.start()
        _, err = process.communicate(timeout=300)
        return process.returncode, time.monotonic() - begun, err.decode()


# -- kinds -------------------------------------------------------------------------------------------------------------


def _missions(folder: Path, rng: random.Random, count: int) -> None:
    """Write ``m0.yaml``, … with zones in the way that are planned around in well under a second."""
    for k in range(count):
        places = [(rng.uniform(500.0, 3500.0), rng.uniform(-900.0, 900.0)) for _ in range(30)]
        zones = [{"name": f"z{i}", "center": p, "radius_m": 60} for i, p in
                 enumerate(large_inputs.degrees(places))]  # fmt: skip
        with _inside(folder):
            large_inputs.mission(zones, goal=(4000.0, rng.uniform(-100.0, 100.0)))
            Path("m.yaml").rename(f"m{k}.yaml")


@contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def plan(folder: Path, rng: random.Random, _: ExitStack) -> Case:
    """A plan with a report, into an empty folder or over another plan."""
    _missions(folder, rng, 2)
    case = Case(["plan", "m0.yaml", "-o", "out", "--report", "--json"], folder, "out")
    if rng.random() < 0.5:
        other = Case(["plan", "m1.yaml", "-o", "out", "--report"], folder, "out")
        other.undisturbed()
        case.before = other.tree()
    return case


def check(folder: Path, rng: random.Random, _: ExitStack) -> Case:
    """A long check with a report."""
    with _inside(folder):
        large_inputs.mission()
        large_inputs.waypoints(large_inputs.snake(rng.randrange(50, 400)))
    arguments = ["check", "m.yaml", "u.waypoints", "--way-home", "--report", "out/r.html", "--json"]
    (folder / "out").mkdir()
    return Case(arguments, folder, "out")


def batch(folder: Path, rng: random.Random, _: ExitStack) -> Case:
    """A batch, alone or with two processes."""
    count = rng.randrange(2, 6)
    _missions(folder, rng, count)
    arguments = ["batch", *(f"m{k}.yaml" for k in range(count)), "-o", "out", "--jobs", rng.choice("12"), "--json"]
    moving = ("results.csv", "results.parquet", "index.html")
    return Case(arguments, folder, "out", steps=True, moving=moving)


def dem(folder: Path, rng: random.Random, stack: ExitStack) -> Case:
    """Tiles from a slow server."""
    served = Served()
    cells = [Cell(36, lon) for lon in range(-86, -86 + rng.randrange(2, 6))]
    for cell in cells:
        served.put_tile(cell)
    served.put_lists(land=cells)

    def slow(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        time.sleep(rng.uniform(0.0, 0.4))
        return False

    served.trouble = slow
    url = stack.enter_context(serving(served)).url
    names = ",".join(cell.name for cell in cells)
    environment = {"no_proxy": "127.0.0.1", "GCSPLAN_DEM_CACHE": str(folder / "out"), "GCSPLAN_DEM_MIRROR": url}
    arguments = ["dem", "fetch", "--source", "copernicus-glo30", "--tiles", names, "--json"]
    return Case(arguments, folder, "out", steps=True, moving=tuple(f"{c.name}.json" for c in cells),
                environment=environment)  # fmt: skip


def upload(folder: Path, rng: random.Random, stack: ExitStack) -> Case:
    """A mission of some hundred items to a simulated vehicle over a bad link."""
    with _inside(folder):
        large_inputs.mission()
        large_inputs.waypoints(large_inputs.snake(rng.randrange(50, 400)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    trouble = f"drop=0.02,delay=0.1,delay_s=0.05,seed={rng.randrange(1000)}"
    arguments = ["sim", "m.yaml", "--listen", f"udpin:127.0.0.1:{port}", "--misbehave", trouble]
    vehicle = Case(arguments, folder, "").start()

    def landed() -> None:
        vehicle.kill()
        vehicle.communicate()

    stack.callback(landed)
    time.sleep(1.0)
    to = f"udpout:127.0.0.1:{port}"
    return Case(["upload", "u=u.waypoints", "--mission", "m.yaml", "--to", to, "--json"], folder, "")


KINDS: dict[str, Callable[[Path, random.Random, ExitStack], Case]] = {
    f.__name__: f for f in (plan, check, batch, dem, upload)
}


# -- attacks -----------------------------------------------------------------------------------------------------------


def _used_s(process: int) -> float:
    """Seconds of the processor that a process and its ended children have used."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return sum(int(t) for t in fields[11:15]) / os.sysconf("SC_CLK_TCK")


def _ended_s() -> float:
    """The same of all children of this process that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def left_over(session: int) -> list[int]:
    """Processes of a session that still run."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(folder.name))
    return found


@dataclass
class End:
    """The end of a command after its signal."""

    number: signal.Signals
    code: int
    out: str
    err: str
    clock_s: float


def interrupt(case: Case, number: signal.Signals, after_s: float, *, group: bool) -> tuple[End, list[str]]:
    """Run the command and send it a signal; return how it ended, and the faults of its processes."""
    ended_s = _ended_s()
    process, found = case.start(), []
    time.sleep(after_s)
    before_s, begun = 0.0, time.monotonic()
    try:
        before_s = _used_s(process.pid)
        (os.killpg if group else os.kill)(process.pid, number)
    except ProcessLookupError:
        pass
    try:
        out, err = process.communicate(timeout=PATIENCE_BY_CLOCK_S)
        clock_s = time.monotonic() - begun
    except subprocess.TimeoutExpired:
        found.append(f"still runs after {PATIENCE_BY_CLOCK_S:g} s")
        os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
        clock_s = PATIENCE_BY_CLOCK_S
    until = time.monotonic() + 5.0
    while (left := left_over(process.pid)) and time.monotonic() < until:
        time.sleep(0.05)
    if left:
        found.append(f"processes are left: {left}")
        os.killpg(process.pid, signal.SIGKILL)
    took_s = _ended_s() - ended_s - before_s
    if before_s > 0.0 and took_s > PATIENCE_S:
        found.append(f"took {took_s:.1f} s of the processor to end")
    return End(number, process.returncode, out.decode(), err.decode(), clock_s), found


def wrong_end(end: End, own_code: int) -> list[str]:
    """Faults of an exit code, of the messages and of the document."""
    if "Traceback" in end.err and "gcsplan" not in end.err:
        return []  # while Python starts, before any line of gcsplan
    found = []
    if "Traceback" in end.err or "Warning" in end.err:
        found.append(f"standard error: {end.err[-600:]}")
    if end.code == -end.number and not end.out:
        return found  # before it began to listen
    if end.code not in (CODES[end.number], own_code, -end.number):  # the last: after it has ended, while Python does
        found.append(f"ended with {end.code}: {end.err[-300:]}")
    try:
        document = json.loads(end.out)
        if end.code == CODES[end.number] and document.get("error", {}).get("code") != end.code:
            found.append(f"the document lacks the outcome: {end.out[-300:]}")
    except json.JSONDecodeError as why:  # a document that was being printed may be cut off: the exit code shows the end
        cut_off = end.code == CODES[end.number] and end.out.startswith("{") and why.msg != "Extra data"
        if not cut_off:
            found.append(f"standard output is no JSON document: {end.out[-300:]!r}, {end.err[-300:]!r}")
    if end.code == CODES[end.number] and sum(line.startswith("gcsplan: ") for line in end.err.splitlines()) != 1:
        found.append(f"not one message: {end.err!r}")
    return found


def wrong_files(case: Case) -> list[str]:
    """Faults of what an interrupted command left."""
    now = case.tree()
    found = [f"left {name}" for name in now if HIDDEN in name and name not in case.before]
    if not case.steps:
        if now not in (case.before, case.after):
            found.append(f"files of neither before nor after: {sorted(now)}")
        return found
    for name, content in now.items():
        if name in case.after and content != case.after[name]:
            found.append(f"{name} is neither as before nor as after")
    folders = {name.rsplit("/", 1)[0] for name in case.after if "/" in name and not name.startswith("records")}
    for folder in sorted(folders):
        own = {n for n in case.after if n.rsplit("/", 1)[0] == folder}
        if case.arguments[0] == "batch" and 0 < len(own & set(now)) < len(own):
            found.append(f"a part of {folder}: {sorted(own & set(now))}")
    if case.arguments[0] == "dem":
        found += [f"{n} has no record" for n in now if n.endswith(".tif") and n[:-3] + "json" not in now]
    return found


def site(seed: int, place: Path, kind: str, stack: ExitStack) -> tuple[Case, list[str]]:
    """A command that was run undisturbed once, and faults of that."""
    folder = place / "site"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    case = KINDS[kind](folder, random.Random(seed), stack)
    case.put_back()
    case.code, case.lasts_s, err = case.undisturbed()
    case.after = case.tree()
    return case, [f"undisturbed it ended with {case.code}: {err[-300:]}"] if case.code not in (0, 4) else []


def attack(case: Case, rng: random.Random) -> tuple[str, End, list[str]]:
    """One round; returns the action, the end of the command, and every fault."""
    case.put_back()
    number, group = rng.choice(list(CODES)), rng.random() < 0.5
    after_s = case.lasts_s * rng.uniform(0.05, 1.05)
    end, found = interrupt(case, number, after_s, group=group)
    found += wrong_end(end, case.code) + wrong_files(case)
    if rng.random() < AGAIN:
        code, _, err = case.undisturbed()
        now = case.tree()
        if code != case.code or now != case.after:
            differ = sorted(n for n in {*now, *case.after} if now.get(n) != case.after.get(n))
            found.append(f"again it ends with {code}, and these differ: {differ}: {err[-300:]}")
    return f"{number.name} to {'all' if group else 'one'} after {after_s:.2f} of {case.lasts_s:.2f} s", end, found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=10**9, help="at most this many rounds")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    given = parser.parse_args()
    until, seed, rounds, faulty, clock_s = time.monotonic() + given.seconds, given.seed, 0, 0, 0.0
    count: Counter[str] = Counter()

    def more() -> bool:
        return time.monotonic() < until and rounds < given.rounds and faulty < 20

    with workshop() as place:
        while rounds == 0 or more():
            kind = given.kinds[seed % len(given.kinds)]
            with ExitStack() as stack:
                case, found = site(seed, place, kind, stack)
                for k in range(ROUNDS):
                    if found or (rounds and not more()):
                        break
                    what, end, found = attack(case, random.Random(f"{seed} {k}"))
                    rounds, clock_s = rounds + 1, max(clock_s, end.clock_s)
                    count[f"{kind} {'interrupted' if end.code == CODES[end.number] else end.code}"] += 1
                    found = [f"round {k + 1}, {what}: {words}" for words in found]
            faulty += bool(found)
            for words in found:
                print(f"seed {seed} ({kind}): {words}", flush=True)
            seed += 1
    print(f"{rounds} rounds, {faulty} faults, {clock_s:.1f} s from signal to end at most")
    print("\n".join(f"  {what}: {many}" for what, many in sorted(count.items())))
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
