"""Inputs below, at and beyond every limit that docs/safety.md states: taken within what it states, or refused by name.

``write(kind, count, seed)`` writes the files of one input into the current folder and returns the arguments of
``gcsplan``. `SIZES` has every kind of input with its limit and with the time that one at the limit may take.

    python -m tests.campaigns.sizes KIND COUNT [SEED]     # writes one input here, and prints its command

`campaign` runs inputs of random kinds and sizes. Each must end with an exit code of the contract, within the processor
time that is stated for its size and a gigabyte; beyond a limit it must be refused by name (exit 2), and at the limit it
must not be.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import pkgutil
import random
import re
import shlex
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import gcsplan
from gcsplan.cli import main
from tests.campaigns import large_inputs, large_logs, large_terrain, large_zones
from tests.campaigns.disk import workshop

Kind = Callable[[Any, random.Random], list[str]]


@dataclass(frozen=True, slots=True)
class Size:
    """One kind of input: who makes it, and what docs/safety.md states of it."""

    make: Kind
    most: float
    """The largest amount that must be taken."""

    within_s: float
    """Seconds of the processor that any amount up to `most`, or a refusal, takes at most."""

    refused: float | None = None
    """The amount beyond which it must be refused by name; None if any amount is judged, more coarsely perhaps."""

    least: float = 4
    """The smallest amount that makes sense."""

    taken: bool = True
    """Whether an amount up to `most` may not be refused: damage is, whatever its amount."""


FILES = {
    size.make.__name__: size
    for size in (
        Size(large_zones.corners_checked, 20_000, 5, 100_000),
        Size(large_zones.crossing, 330, 5, 400),
        Size(large_zones.arcs, 100, 6, 2000),
        Size(large_inputs.items, 10_000, 6, 10_000),
        Size(large_inputs.items_at_home, 10_000, 60, 10_000),
        Size(large_inputs.items_drawn, 10_000, 20, 10_000),
        Size(large_inputs.splines, 10_000, 60, 10_000),
        Size(large_inputs.jumps, 9985, 20, 9985),
        Size(large_inputs.unknown_keys, 240_000, 6, None, taken=False),
        Size(large_terrain.reach_to_unknown, 2400, 20, 2500),
        Size(large_inputs.parameters, 250_000, 5, 280_000),
        Size(large_inputs.tiles_named, 2000, 5, None, taken=False),
        Size(large_logs.log, 999_999, 10, 999_999, least=1000),
        Size(large_logs.readings, 1_999_990, 40, 2_000_100, least=4000),
        Size(large_logs.messages, 1_999_990, 80, 2_000_100, least=400),
        Size(large_logs.noise, 255, 40, 256, least=1, taken=False),
        Size(large_logs.formats, 255, 20, 256, least=1, taken=False),
        Size(large_logs.same_format, 255, 20, 256, least=1, taken=False),
        Size(large_logs.small_records, 255, 10, 256, least=1, taken=False),
        Size(large_logs.tlog_noise, 255, 20, 256, least=1, taken=False),
    )
}
"""Kinds that are read and checked, without a planner."""

WORLDS = {
    size.make.__name__: size
    for size in (
        Size(large_zones.corners, 20_000, 10, 100_000),
        Size(large_zones.spikes_far_away, 24_000, 5, 38_000),
        Size(large_zones.coast, 99_999, 5, 100_000),
        Size(large_zones.corners_at_home, 20_000, 25, 100_000),
        Size(large_zones.corners_fenced, 20_000, 10, 100_000, taken=False),
        Size(large_zones.corners_drawn, 20_000, 25, 100_000),
        Size(large_zones.corners_in_geopackage, 99_000, 5, 100_000),
        Size(large_zones.fan, 6000, 5, 33_400),
        Size(large_zones.corridor, 4000, 6, 20_000),
        Size(large_zones.river, 20_000, 5, 20_000),
        Size(large_zones.cylinders, 20_000, 15, 20_000),
        Size(large_zones.wide_cylinders, 20_000, 15, 20_000),
        Size(large_zones.forest, 20_000, 20, 20_000),
        Size(large_zones.great_circles, 800, 12, 20_000),
        Size(large_zones.squares_in_kml, 20_000, 20, 20_000),
        Size(large_zones.squares_in_openair, 20_000, 20, 20_000),
        Size(large_zones.squares_in_kmz, 20_000, 20, 20_000),
        Size(large_zones.members_of_kmz, 100_000, 15, 400_000),
        Size(large_zones.bomb_in_kmz, 19, 5, 21, least=1, taken=False),
        Size(large_zones.squares_in_ed318, 20_000, 20, 20_000),
        Size(large_zones.squares_in_openaip, 20_000, 20, 20_000),
        Size(large_zones.masts, 20_000, 20, 20_000),
        Size(large_zones.geopackage, 20_000, 15, 20_000),
        Size(large_zones.shapefile, 20_000, 15, 20_000),
        Size(large_zones.flatgeobuf, 20_000, 15, 20_000),
        Size(large_inputs.vias, 500, 5, 500),
        Size(large_inputs.cells, 49, 5, 51, least=0.01),
        Size(large_inputs.tiles, 2000, 10, 2000, least=9),
        Size(large_terrain.dat_megabytes, 255, 15, 270, least=40),
        Size(large_terrain.dat_files, 64_800, 15, None),
        Size(large_terrain.dat_posts, 22, 15, 26, least=1),
        Size(large_inputs.fleet, 100, 20, 2000, least=1),
        Size(large_inputs.long_wing, 240, 20, None, least=1),
        Size(large_inputs.wing_over_cells, 240, 40, None, least=1),
        Size(large_inputs.wing_over_hills, 240, 40, None, least=1),
        Size(large_inputs.runs, 100, 5, 10_000, least=1),
    )
}
"""Kinds that are planned."""

SIZES = FILES | WORLDS

MEMORY_MB = 1000.0
"""Most megabytes of one input."""

CODES = {0, 2, 3, 4}

AT_S, BEYOND = 0.08, 0.4
"""Seconds for each input that are spent on inputs at a limit, about; the part of inputs that is beyond one."""


def amount(size: Size, rng: random.Random) -> tuple[float, str]:
    """An amount of a kind, and where it lies: below its limit (a twentieth of it at most), at it, or beyond it."""
    whole = (lambda x: x) if size.least < 1 else (lambda x: max(int(x), int(size.least)))
    if rng.random() < min(AT_S / size.within_s, 0.1):
        return (size.most if rng.random() < 0.5 else whole(size.most * rng.uniform(0.3, 1.0))), "at"
    if rng.random() < BEYOND and size.refused is not None:
        more = size.refused if rng.random() < 0.5 else size.refused * 1.5 ** rng.uniform(0.0, 1.0)
        return (whole(more) + 1 if size.least >= 1 else 1.01 * more), "beyond"
    return whole(size.least * max(size.most / size.least / 20.0, 1.0) ** rng.random()), "below"


@contextlib.contextmanager
def place() -> Iterator[None]:
    """Work in a folder of its own, in memory."""
    with workshop() as folder, contextlib.chdir(folder):
        yield


def warm() -> None:
    """Import all that a command may import, once for all forks: that is most of the time of a small input."""
    for module in pkgutil.walk_packages(gcsplan.__path__, "gcsplan."):
        if not module.name.startswith(("gcsplan.bench", "gcsplan.__main__")):
            importlib.import_module(module.name)


def run(kind: str, count: float, seed: int) -> tuple[int, float, float, str]:
    """Exit code, processor seconds, megabytes and last words of one input; written into the current folder.

    It runs in a fork of this process. Its time is measured by the processor's clock, so that other work on the machine
    counts little.
    """
    arguments = write(kind, count, seed)
    with tempfile.TemporaryFile("w+") as err:
        process = os.fork()
        if process == 0:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(err.fileno(), 2)
            sys.argv = ["gcsplan", *arguments]
            try:
                main.entry()
            except SystemExit as end:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(end.code if isinstance(end.code, int) else 70)
            finally:
                os._exit(70)
        until = time.monotonic() + 20.0 * SIZES[kind].within_s  # busy machines
        while not (ended := os.wait4(process, os.WNOHANG))[0]:
            if time.monotonic() > until:
                os.kill(process, signal.SIGKILL)
                ended = os.wait4(process, 0)
                break
            time.sleep(0.01)
        err.seek(0)
        words = err.read()[-300:]
    used = ended[2]
    return os.waitstatus_to_exitcode(ended[1]), used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0, words


def faults(size: Size, where: str, code: int, took_s: float, held_mb: float, words: str) -> list[str]:
    """The faults of an input's end."""
    found = [] if code in CODES else [f"ended with {code}: {words}"]
    found += [f"took {took_s:.1f} s of the processor, not {size.within_s:g}"] if took_s > size.within_s else []
    found += [f"held {held_mb:.0f} MB"] if held_mb > MEMORY_MB else []
    found += [f"a traceback: {words}"] if "Traceback" in words else []
    found += [f"was not refused: {code}"] if where == "beyond" and code != 2 else []
    found += [f"was refused: {words}"] if where != "beyond" and code == 2 and size.taken else []
    return found


@dataclass
class Row:
    """Figures of one kind: inputs by where they lie, refusals, faults, and the most seconds and megabytes."""

    ran: Counter[str]
    faulty: int = 0
    took_s: float = 0.0
    held_mb: float = 0.0

    def line(self, kind: str) -> str:
        """The row as people read it."""
        where = ", ".join(f"{self.ran[w]} {w}" for w in ("below", "at", "beyond"))
        codes = ", ".join(f"{n} exit {k[5:]}" for k, n in sorted(self.ran.items()) if k.startswith("exit "))
        most = f"{self.took_s:.1f} s and {self.held_mb:.0f} MB at most"
        return f"{kind:22} {where} ({codes}), {self.faulty} faults, {most}"


def campaign(sizes: Mapping[str, Size], seconds: float, seed: int, inputs: int = 10**9) -> int:
    """Run inputs of random kinds and amounts; print faults as they come, and figures by kind at the end.

    Why inputs are refused is counted, without numbers and names.
    """
    until, done = time.monotonic() + seconds, 0
    warm()
    reasons: Counter[str] = Counter()
    rows = {kind: Row(Counter()) for kind in sizes}
    while done < inputs and time.monotonic() < until:
        rng = random.Random(seed)
        kind = rng.choice(list(sizes))
        count, where = amount(sizes[kind], rng)
        with place():
            code, took_s, held_mb, words = run(kind, count, seed)
        if code == 2:
            last = words.strip().split("\n")[-1]
            reasons[f"{where} {kind}: " + re.sub(r"[^ :]*[\d'][^ :]*", "#", last)[-150:]] += 1
        wrong = faults(sizes[kind], where, code, took_s, held_mb, words)
        for what in wrong:
            print(f"seed {seed} ({kind} of {count:g}): {what}", flush=True)
        row = rows[kind]
        row.ran.update([where, f"exit {code}"])
        row.faulty += bool(wrong)
        row.took_s, row.held_mb = max(row.took_s, took_s), max(row.held_mb, held_mb)
        seed, done = seed + 1, done + 1
    for kind, row in rows.items():
        print(row.line(kind))
    for why, many in reasons.most_common():
        print(f"{many:6} refused {why}")
    faulty = sum(row.faulty for row in rows.values())
    print(f"{done} inputs, {faulty} faults, the next seed is {seed}")
    return 1 if faulty else 0


def write(kind: str, count: float, seed: int = 1) -> list[str]:
    """Write one input into the current folder; return the arguments of ``gcsplan``."""
    return SIZES[kind].make(count, random.Random(seed))


if __name__ == "__main__":
    given = sys.argv[1:]
    count = float(given[1])
    words = write(given[0], int(count) if count == math.floor(count) else count, int(given[2]) if len(given) > 2 else 1)
    print("gcsplan", shlex.join(words))
