"""Hostile files: randomly corrupted mission files, zones, other programs' missions and terrain, by the command line.

    python -m tests.campaigns.files --seconds 120 [--seed 1] [--inputs N] [--keep DIR] [--sizes]

Each input is one run of ``gcsplan check --json`` with one or more files corrupted as people, programs and attackers
do. The run must end with one of the exit codes in `CODES`, print one JSON document, no traceback and no warning, write
only messages to standard error, leave no new file, and need at most `PATIENCE_S` and `MEMORY_MB`. Inputs run in a
separate process, so that a crash of a library is recognised. Exits with 1 and prints the seed if any of that fails;
``--seed S --inputs 1 --keep DIR`` repeats that input.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from gcsplan.cli import main as cli
from tests.campaigns import sizes
from tests.campaigns.disk import workshop
from tests.campaigns.hostile import KINDS, write_clean
from tests.support.paths import REPOSITORY

CODES = {0, 2, 3, 4}
PATIENCE_S = 10.0
"""Most processor seconds of a run; by the clock, a run counts as hanging after ten times as much (busy machines)."""

MEMORY_MB = 600.0
MAX_FOUND = 20


def attack(seed: int) -> tuple[str, int, list[str]]:
    """Run the input of that seed in the current folder; return its kind, the exit code, and the faults."""
    rng = random.Random(seed)
    kind = rng.choices(list(KINDS), [weight for weight, _ in KINDS.values()])[0]
    arguments = KINDS[kind][1](rng)
    before = set(os.listdir())
    out, err, began = io.StringIO(), io.StringIO(), time.process_time()
    code: Any = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("always")
        sys.argv = ["gcsplan", "check", *arguments, "--json"]
        try:
            cli.main()
        except SystemExit as ended:
            code = ended.code
        except BaseException as error:  # no exception may escape
            code = f"{type(error).__name__}: {error}"
    took = time.process_time() - began
    found = civil(code, out.getvalue(), err.getvalue())
    if set(os.listdir()) != before:
        found.append(f"left {sorted(set(os.listdir()) - before)}")
    if took > PATIENCE_S:
        found.append(f"took {took:.1f} s of the processor")
    return kind, code if isinstance(code, int) else -1, [f"seed {seed} ({kind}): {what}" for what in found]


def civil(code: object, out: str, err: str) -> list[str]:
    """Faults of how a run ended: its exit code, standard output and standard error."""
    found = [] if code in CODES else [f"ended with {code}: {err[-400:]}"]
    try:
        document = json.loads(out)
        if ("error" in document) != (code != 0) or (code != 0 and document["error"]["code"] != code):
            found.append("the document lacks the outcome")
    except ValueError:
        found.append(f"standard output is no JSON document: {out[:200]!r}")
    found += [f"standard error holds a {word}: {err[-400:]}" for word in ("Traceback", "Warning") if word in err]
    if code == 2 and not err.startswith("gcsplan: "):
        found.append(f"no message on standard error: {err[:200]!r}")
    return found


def work(seed: int) -> None:
    """Run inputs for ever; write JSON lines on the real standard output when each begins and ends."""
    real = os.fdopen(os.dup(1), "w")
    library_words = tempfile.TemporaryFile()  # noqa: SIM115  # stays open as long as the process
    os.dup2(library_words.fileno(), 1)
    os.dup2(library_words.fileno(), 2)  # libraries write there without Python
    write_clean()
    while True:
        print(json.dumps(["begins", seed]), file=real, flush=True)
        kind, code, found = attack(seed)
        if library_words.tell():
            library_words.seek(0)
            found.append(f"seed {seed} ({kind}): a library wrote {library_words.read()[:300]!r}")
            library_words.seek(0)
            library_words.truncate()
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        if memory_mb > MEMORY_MB:
            found.append(f"seed {seed} ({kind}): {memory_mb:.0f} MB are held")
        print(json.dumps(["ended", kind, code, found, memory_mb]), file=real, flush=True)
        seed += 1


def campaign(seconds: float, seed: int, inputs: int, keep: str | None) -> int:
    """Run inputs in a `Worker`, restart it when it dies, print faults and a summary; return the exit code."""
    count: Counter[str] = Counter()
    found: list[str] = []
    memory_mb, until = 0.0, time.monotonic() + seconds
    with workshop() as place:
        folder = Path(keep or place)
        folder.mkdir(exist_ok=True)
        while sum(count.values()) < inputs and time.monotonic() < until and len(found) < MAX_FOUND:
            with Worker(folder, seed) as worker:
                while sum(count.values()) < inputs and time.monotonic() < until and len(found) < MAX_FOUND:
                    answer = worker.answer()
                    kind, code, faults, held_mb = answer or ("none", -1, [f"seed {worker.seed}: {worker.fate()}"], 0.0)
                    count[f"{kind} {code}"] += 1
                    found += faults
                    for line in faults:
                        print(line, flush=True)
                    if answer is None:
                        break
                    memory_mb = max(memory_mb, held_mb)
                    if held_mb > MEMORY_MB:
                        break
                seed = worker.seed + 1
    print(_summary(count, len(found), memory_mb))
    return 1 if found else 0


class Worker:
    """A process that runs one input after the other, and its answers."""

    def __init__(self, folder: Path, seed: int) -> None:
        command = [sys.executable, "-m", "tests.campaigns.files", "--work", "--seed", str(seed)]
        paths = os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")])
        environment = os.environ | {"PYTHONPATH": paths}
        self.process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, env=environment)
        self.seed = seed
        self._answered = b""

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def answer(self) -> tuple[str, int, list[str], float] | None:
        """Kind, exit code, faults and memory (MB) of the next input; None if the process does not answer."""
        while True:
            line = self._line(10.0 * PATIENCE_S)
            if not line:
                return None
            word, *rest = json.loads(line)
            if word == "ended":
                kind, code, faults, memory_mb = rest
                return kind, code, faults, memory_mb
            self.seed = rest[0]

    def fate(self) -> str:
        """Why there is no answer."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return f"the process ended with {self.process.wait(1.0)}"
        return f"no answer in {10.0 * PATIENCE_S:g} s"

    def _line(self, seconds: float) -> bytes:
        assert self.process.stdout is not None
        handle, until = self.process.stdout.fileno(), time.monotonic() + seconds
        while b"\n" not in self._answered:
            left = until - time.monotonic()
            more = os.read(handle, 65536) if left > 0.0 and select.select([handle], [], [], left)[0] else b""
            if not more:
                return b""
            self._answered += more
        line, _, self._answered = self._answered.partition(b"\n")
        return line


def _summary(count: Counter[str], faults: int, memory_mb: float) -> str:
    kinds = sorted({key.split()[0] for key in count})
    each = []
    for kind in kinds:
        codes = {key.split()[1]: n for key, n in sorted(count.items()) if key.split()[0] == kind}
        each.append(f"  {kind}: {sum(codes.values())} (" + ", ".join(f"exit {c}: {n}" for c, n in codes.items()) + ")")
    return f"{sum(count.values())} inputs, {faults} faults, {memory_mb:.0f} MB at most\n" + "\n".join(each)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=10**9, help="at most this many inputs")
    parser.add_argument("--keep", metavar="DIR", help="work in DIR, and leave the files of the last input")
    parser.add_argument("--sizes", action="store_true", help="large inputs, not spoilt ones (tests.campaigns.sizes)")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work(given.seed)
    if given.sizes:
        return sizes.campaign(sizes.FILES, given.seconds, given.seed, given.inputs)
    return campaign(given.seconds, given.seed, given.inputs, given.keep)


if __name__ == "__main__":
    sys.exit(main())
