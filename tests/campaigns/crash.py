"""Kills and power losses at every change to an output directory: it must never mix two plans and never lose a file.

    python -m tests.campaigns.crash --seconds 120 [--seed 1]

Each round makes a directory with a random past (plans, other people's files, edited and retired files) and a random
step from one plan to the next, and then

- kills the process with SIGKILL before each system call of the step that changes anything, and in the middle of each
  write, sometimes again (up to three times) while the next runs recover;
- simulates a loss of power after each operation: any part that no fsync has secured may be missing
  (`tests.campaigns.disk`);
- lets two processes write at once;
- kills and cuts power while a single file of the user's choice is written over an older one.

After each attack, the file names alone must show files of one plan at most; gcsplan must see a whole plan or refuse;
other people's files must all be there; and the next run must restore exactly the state before the step, or complete
the step. Exits with 1 and prints the round's seed if any of that fails.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import pickle
import random
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.export.generation import STAGE
from gcsplan.export.outdir import (
    MANIFEST,
    PREVIOUS,
    add_output,
    require_settled,
    retire_outputs,
    settle_outputs,
    write_outputs,
    write_whole,
)
from tests.campaigns.disk import Operation, Recorder, Tree, states, workshop

Step = Callable[[Path], object]

_CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.truncate", "shutil.rmtree"}
_WRITING = os.O_CREAT | os.O_WRONLY | os.O_RDWR | os.O_TRUNC
POWER_STATES = 4
"""Disk states drawn for each point of power loss."""


@dataclass(frozen=True)
class World:
    """A directory before and after a step, the step that is attacked, and the contents of other people's files."""

    before: Tree
    after: Tree
    step: Step
    theirs: Counter[bytes]


# -- worlds -----------------------------------------------------------------------------------------------------------


def plan_files(rng: random.Random, tag: str) -> dict[str, bytes]:
    """Outputs of a plan; each file's content names the plan."""
    vehicles = [f"uav{k}" for k in range(1, rng.choice((2, 3, 4)))]
    names = [f"{v}.{kind}" for v in vehicles for kind in ("plan", "waypoints")]
    names += rng.sample(["mission.kml", "summary.json", "profile.csv", "report.html", "upload.json"], rng.randrange(4))
    return {name: f"plan {tag} {name} {'x' * rng.randrange(90)}".encode() for name in names}


def past(root: Path, rng: random.Random) -> None:
    """Make a directory with the results of earlier runs and of people's changes in between."""
    for k in range(rng.randrange(4)):
        kind = rng.random()
        if kind < 0.6:
            write_outputs(root, plan_files(rng, f"p{k}"))
        elif kind < 0.8 and root.is_dir():
            retire_outputs(root)
        elif root.is_dir():
            present = [p for p in root.iterdir() if p.is_file() and p.name != MANIFEST]
            for path in rng.sample(present, min(len(present), rng.randrange(3))):
                path.write_bytes(f"mine {k} {path.name}".encode())  # edited
    root.mkdir(exist_ok=True)
    for name in rng.sample(["notes.txt", "uav1.plan", "mission.kml", "uav2.waypoints", "x.json"], rng.randrange(3)):
        (root / name).write_bytes(f"mine too {name}".encode())
    if rng.random() < 0.3:
        (root / PREVIOUS).mkdir(exist_ok=True)
        (root / PREVIOUS / "uav1.plan").write_bytes(b"mine, in previous")


def next_step(rng: random.Random) -> Step:
    """A random step that a run does in the directory: write outputs, retire them, or add one."""
    files = plan_files(rng, "new")
    kind = rng.random()
    if kind < 0.6:
        return lambda root: write_outputs(root, files)
    if kind < 0.85:
        return retire_outputs
    return lambda root: add_output(root, "upload.json", b"added")


def world(place: Path, rng: random.Random) -> World:
    """A random world; the step is tried out once in ``place``."""
    root = place / "out"
    past(root, rng)
    step, before = next_step(rng), tree_of(root)
    step(root)
    after = tree_of(root)
    shutil.rmtree(root)
    return World(before, after, step, strangers(before))


def tree_of(root: Path) -> Tree:
    """Every path under ``root``, with its content; None for a directory."""
    if not root.is_dir():
        return {}
    return {p.relative_to(root).as_posix(): None if p.is_dir() else p.read_bytes() for p in sorted(root.rglob("*"))}


def put(root: Path, tree: Tree) -> None:
    """Replace ``root`` by the given tree."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    for name, content in sorted(tree.items()):
        if content is None:
            (root / name).mkdir()
        else:
            (root / name).write_bytes(content)


def strangers(tree: Tree) -> Counter[bytes]:
    """Contents of other people's files, with the number of copies of each."""
    return Counter(c for c in tree.values() if c is not None and c.startswith(b"mine"))


def without_stage(tree: Tree) -> Tree:
    """The tree without gcsplan's staging area."""
    return {name: c for name, c in tree.items() if name.partition("/")[0] != STAGE}


# -- requirements -----------------------------------------------------------------------------------------------------


def mixtures(tree: Tree) -> list[str]:
    """Faults: directories that contain files of more than one plan."""
    seen: dict[str, set[bytes]] = {}
    for name, content in without_stage(tree).items():
        if content is not None and content.startswith(b"plan "):
            seen.setdefault(name.rpartition("/")[0], set()).add(content[5:].partition(b" ")[0])
    return [f"{folder or 'the directory'} shows plans {sorted(tags)}" for folder, tags in seen.items() if len(tags) > 1]


def faults(root: Path, of: World) -> list[str]:
    """Faults of a directory after an attack, and of what the next runs make of it."""
    tree = tree_of(root)
    found = mixtures(tree)
    known = {*of.before.values(), *of.after.values()}
    found += [f"{name} is torn: {c!r}" for name, c in without_stage(tree).items() if c not in known]
    if strangers(tree) != of.theirs:
        found.append(f"files of others are missing: {of.theirs - strangers(tree)}")
    whole = without_stage(tree) in (of.before, of.after)
    try:
        require_settled([root / "any"])
        if not whole:
            found.append("a directory that is neither the old plan nor the new one is taken for whole")
    except InputError:
        pass
    try:
        settle_outputs(root)
        settled = tree_of(root)
        if without_stage(settled) not in (of.before, of.after):
            found.append("the next run did not bring it back")
        of.step(root)
    except Exception as error:  # any error here is a fault
        return [*found, f"the next run failed: {type(error).__name__}: {error}"]
    if tree_of(root) != of.after:
        found.append("the step, taken again, did not end where it should")
    return found


# -- attacks ----------------------------------------------------------------------------------------------------------


def in_child(work: Callable[[], object]) -> int:
    """Run ``work`` in a forked process; return its exit code, or minus the number of the signal that ended it."""
    child = os.fork()
    if child == 0:
        code = 70
        with contextlib.suppress(BaseException):
            work()
            code = 0
        os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def killed_before(change: int, work: Callable[[], object]) -> Callable[[], object]:
    """``work``, killed before its change number ``change`` (from 0); if that is a write, half is written first."""
    count = 0

    def tick(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if event in _CHANGES or (event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING):
            if count == change:
                os.kill(os.getpid(), signal.SIGKILL)
            count += 1

    def write(handle: int, data: bytes) -> int:
        nonlocal count
        if count == change:
            real(handle, data[: len(data) // 2])
            os.kill(os.getpid(), signal.SIGKILL)
        count += 1
        return real(handle, data)

    def run() -> None:
        sys.addaudithook(tick)
        os.write = write  # os.write raises no audit event
        work()

    real = os.write
    return run


def kills(root: Path, of: World, rng: random.Random) -> Iterator[list[str]]:
    """Kill the step at every change, in half of the cases also the next runs while they recover; yield their faults."""
    for change in range(10_000):
        put(root, of.before)
        ended = in_child(killed_before(change, lambda: of.step(root)))
        if ended != 0 and rng.random() < 0.5:
            for _ in range(rng.choice((1, 1, 2, 3))):
                in_child(killed_before(rng.randrange(12), lambda: of.step(root)))
                if mixtures(tree_of(root)):
                    break
        found = faults(root, of)
        if ended not in (0, -signal.SIGKILL):
            found.append(f"the step ended with {ended}")
        yield [f"killed at change {change}: {fault}" for fault in found]
        if ended == 0:
            return


def operations(root: Path, of: World) -> list[Operation]:
    """The disk operations of the step, recorded in a forked process."""
    put(root, of.before)
    reading, writing = os.pipe()
    recorder = Recorder(root)

    def work() -> None:
        recorder.install()
        of.step(root)
        recorder.stop()
        with os.fdopen(writing, "wb") as pipe:
            pickle.dump(recorder.log, pipe)

    with os.fdopen(reading, "rb") as pipe:
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                work()
            os._exit(0)
        os.close(writing)
        log: list[Operation] = pickle.load(pipe)
        os.waitpid(child, 0)
    return log


def power_losses(root: Path, of: World, rng: random.Random, log: list[Operation]) -> Iterator[list[str]]:
    """Cut the power after every operation; yield the faults of each."""
    for done in range(len(log) + 1):
        for tree in states(of.before, log[:done], rng, POWER_STATES):
            put(root, tree)
            yield [f"power lost after operation {done} ({log[done - 1] if done else 'none'}): {fault}"
                   for fault in faults(root, of)]  # fmt: skip


def together(root: Path, of: World, rng: random.Random) -> list[str]:
    """Faults after two processes wrote at once: there must be one whole plan and nothing left over."""
    put(root, of.before)
    plans = [plan_files(rng, tag) for tag in ("one", "two")]
    children = []
    for files in plans:
        child = os.fork()
        if child == 0:
            code = 70
            with contextlib.suppress(BaseException):
                write_outputs(root, files)
                code = 0
            os._exit(code)
        children.append(child)
    codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
    tree = tree_of(root)
    found = mixtures({n: c for n, c in tree.items() if not n.startswith(f"{PREVIOUS}/")})
    if not any(all(tree.get(name) == content for name, content in files.items()) for files in plans):
        found.append("two runs at once left no whole plan")
    if any(name.startswith(STAGE) for name in tree) or codes != [0, 0] or strangers(tree) != of.theirs:
        found.append(f"two runs at once left {sorted(tree)}, codes {codes}")
    return found


def single_files(root: Path, rng: random.Random) -> Iterator[list[str]]:
    """Kill and cut the power while one file is written over an older one; yield the faults of each attack."""
    old, new = b"mine, old", b"new " + b"x" * rng.randrange(200)
    before: Tree = {"notes.txt": b"mine", "x.plan": old}
    of = World(before, before | {"x.plan": new}, lambda out: write_whole(out / "x.plan", new), Counter())

    def faulty(when: str) -> list[str]:
        tree, found = tree_of(root), []
        if tree.get("x.plan") not in (old, new):
            found.append(f"{when} the file is torn: {tree.get('x.plan')!r}")
        of.step(root)
        if tree_of(root) != of.after:
            found.append(f"{when} the next run leaves {sorted(tree_of(root))}")
        return found

    for change in range(100):
        put(root, before)
        ended = in_child(killed_before(change, lambda: of.step(root)))
        yield faulty(f"killed at change {change} of one file:")
        if ended == 0:
            break
    log = operations(root, of)
    for done in range(len(log) + 1):
        for tree in states(before, log[:done], rng, POWER_STATES):
            put(root, tree)
            yield faulty(f"without power after operation {done} of one file:")


def attack(seed: int, place: Path) -> tuple[Counter[str], list[str]]:
    """Run one round; return the number of attacks of each kind, and every fault found."""
    rng = random.Random(seed)
    of, root = world(place, rng), place / "out"
    count, found = Counter[str](), []
    for faulty in kills(root, of, rng):
        count["kills"] += 1
        found += faulty
    for faulty in power_losses(root, of, rng, operations(root, of)):
        count["power losses"] += 1
        found += faulty
    for _ in range(2):
        count["pairs"] += 1
        found += together(root, of, rng)
    for faulty in single_files(root, rng):
        count["single files"] += 1
        found += faulty
    shutil.rmtree(root)
    return count, [f"seed {seed}: {fault}" for fault in found]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=10**9, help="at most this many rounds")
    given = parser.parse_args()
    until, count, rounds = time.monotonic() + given.seconds, Counter[str](), 0
    with workshop() as place:
        while rounds == 0 or (time.monotonic() < until and rounds < given.rounds):
            more, found = attack(given.seed + rounds, place)
            count += more
            rounds += 1
            if found:
                print("\n".join(found[:20]))
                return 1
    print(f"{rounds} directories: " + ", ".join(f"{n} {kind}" for kind, n in count.items()) + "; 0 faults")
    return 0


if __name__ == "__main__":
    sys.exit(main())
