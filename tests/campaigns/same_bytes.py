"""Run the same commands with another commit and with this tree, and compare all files and numbers.

    python -m tests.campaigns.same_bytes COMMIT [--sets gallery papers …] [--count 60] [--checks 300]

For changes that move or rename code and must not change any output. Missions are planned (a part of them in batches),
then files are checked: the missions of the other commit, and each of them with altitudes, places and commands changed.
Compared are exit codes, every `.waypoints`, `.plan` and CSV byte by byte, and the numbers, names and keys of JSON:
further keys, notes, messages and pictures may differ. No clock stops a plan. Prints the differences, and exits with 1
if there are any.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from gcsplan.bench.everyday.missions import EVERYDAY_KINDS, draw
from gcsplan.bench.fleet import fleet_document
from tests.support.paths import MISSIONS, REPOSITORY

SETS = ("gallery", "papers", "terrain", "everyday", "fleets", "turns", "batch")
BYTES, NUMBERS = (".waypoints", ".plan", ".csv", ".param", ".params"), (".json", ".geojson")
SENTENCES = frozenset({"notes", "not_judged", "message", "advice", "headline", "why", "text", "error"})
"""Keys of JSON whose sentences may be reworded."""
SEED = 77
MOST_S = 7200.0
"""Seconds that each tree may take for all commands of a step."""
FLEETS = (2, 3, 5, 9, 16, 30)

Command: TypeAlias = tuple[str, list[str]]
"""The folder for what it writes, and the arguments of gcsplan; its standard output goes to ``stdout.json`` there."""

RUN = """
import contextlib, importlib, io, json, math, os, sys
from gcsplan.planners.budget import Budget
Budget.deadline_s = math.inf
main = importlib.import_module("gcsplan.cli.main").main
for folder, arguments in json.load(open(sys.argv[1])):
    os.makedirs(folder, exist_ok=True)
    sys.argv = ["gcsplan", *arguments]
    code, printed = 0, io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        try:
            main()
        except SystemExit as ended:
            code = ended.code or 0
    open(f"{folder}/stdout.json", "w").write(printed.getvalue())
    print(folder, code, flush=True)
"""


def missions(sets: Sequence[str], count: int) -> Iterator[tuple[str, str]]:
    """Name and text of each mission file that is planned on its own."""
    folders = {"gallery": MISSIONS, "papers": MISSIONS / "papers"}
    for which in sets:
        if which in folders:
            for file in sorted(folders[which].glob("*.yaml")):
                yield f"{which}-{file.stem}", file.read_text(encoding="utf-8")
        elif which == "fleets":
            for vehicles in FLEETS:
                yield f"fleets-{vehicles}", yaml.safe_dump(fleet_document(vehicles, SEED))
        elif which != "batch":
            for k in range(count):
                number = len(EVERYDAY_KINDS) * k + EVERYDAY_KINDS.index("sample") if which == "terrain" else k
                document = draw(SEED, number).document
                if which == "turns":
                    document = turning(document, random.Random(k))
                yield f"{which}-{number}", yaml.safe_dump(document)


def turning(document: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """The mission of a fixed wing instead of a copter's."""
    document["vehicles"][0] |= {
        "autopilot": "arduplane", "turn_radius_m": rng.choice([40.0, 60.0, 90.0]), "speed_m_s": 18.0,
        "takeoff_heading_deg": rng.uniform(0.0, 360.0), "max_climb_deg": 12.0,
    }  # fmt: skip
    return document


def changed(text: str, rng: random.Random) -> str:
    """A `.waypoints` file with one thing in one row changed: its altitude, place, command or a parameter."""
    rows = text.splitlines()
    if len(rows) < 4:
        return text
    at = rng.randrange(2, len(rows))
    cells = rows[at].split("\t")
    kind = rng.choice(["altitude", "place", "command", "parameter", "gone"])
    if kind == "altitude":
        cells[10] = f"{float(cells[10]) + rng.choice([-60.0, -20.0, -1.0, 0.5, 90.0]):.2f}"
    elif kind == "place":
        cells[8] = f"{float(cells[8]) + rng.gauss(0.0, 0.003):.8f}"
    elif kind == "command":
        cells[3] = rng.choice(["16", "17", "19", "20", "21", "31", "82", "93", "178"])
    elif kind == "parameter":
        cells[rng.randrange(4, 8)] = rng.choice(["0.0", "1.0", "15.0", "-1.0"])
    rows[at : at + 1] = [] if kind == "gone" else ["\t".join(cells)]
    return "\n".join(rows) + "\n"


def checks(names: Sequence[str], files: Path, count: int) -> Iterator[Command]:
    """Checks of ``count`` files, a third of them as they were planned, the others with one row changed."""
    rng, seen = random.Random(SEED), 0
    planned = [name for name in names if any((files / name).glob("*.waypoints"))]
    rng.shuffle(planned)
    for turn, name in enumerate(itertools.cycle(planned)):
        if seen >= count:
            return
        given = []
        for file in sorted((files / name).glob("*.waypoints"))[:4]:
            made = files / f"checked-{turn}" / name / file.name
            made.parent.mkdir(parents=True, exist_ok=True)
            text = file.read_text(encoding="utf-8")
            made.write_text(changed(text, rng) if turn % 3 else text, encoding="utf-8")
            given.append(f"{made.stem}={made}")
        seen += len(given)
        how = ["--way-home"] if rng.random() < 0.7 else []
        yield f"check-{turn}-{name}", ["check", f"missions/{name}.yaml", *given, "--json", *how]


def run(tree: Path, folder: Path, out: str, commands: Sequence[Command]) -> dict[str, str]:
    """Run the commands with the code of ``tree``, below ``folder/out``; the exit code of each."""
    (folder / out).mkdir(exist_ok=True)
    given = [(f"{out}/{name}", arguments) for name, arguments in commands]
    (folder / f"{out}.commands").write_text(json.dumps(given), encoding="utf-8")
    env = os.environ | {"PYTHONPATH": str(tree)}
    with (folder / f"{out}.log").open("w", encoding="utf-8") as log:
        ended = subprocess.run(
            [sys.executable, "-c", RUN, f"{out}.commands"], cwd=folder, env=env, stdout=log, timeout=MOST_S, check=False
        )
    if ended.returncode:
        raise SystemExit(f"{tree}: the process ended with {ended.returncode}")
    lines = (folder / f"{out}.log").read_text(encoding="utf-8").splitlines()
    return dict(line.removeprefix(f"{out}/").rsplit(" ", 1) for line in lines)  # type: ignore[arg-type, misc]


def compared(folder: Path) -> dict[str, bytes | Any]:
    """The compared content of the files below a folder, by name."""
    found: dict[str, bytes | Any] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in BYTES and path.is_file():
            found[str(path.relative_to(folder))] = path.read_bytes()
        elif path.suffix in NUMBERS and path.is_file():
            text = path.read_text(encoding="utf-8")
            found[str(path.relative_to(folder))] = json.loads(text) if text.startswith(("{", "[")) else None
    return found


def same(before: Any, now: Any) -> bool:
    """Whether ``now`` has all of ``before``, but for sentences; it may have more keys."""
    if isinstance(before, dict) and isinstance(now, dict):
        return all(key in SENTENCES or (key in now and same(value, now[key])) for key, value in before.items())
    if isinstance(before, list) and isinstance(now, list):
        return len(before) == len(now) and all(map(same, before, now))
    return bool(before == now)


def differing(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """The names of files that differ."""
    return sorted(
        k for k in before.keys() | now.keys() if k not in before or k not in now or not same(before[k], now[k])
    )


def plans(sets: Sequence[str], count: int, out: str, folder: Path) -> list[Command]:
    """The commands that plan, which write below ``out``."""
    names = [name for name, _ in missions(sets, count)]
    found: list[Command] = [(name, ["plan", f"missions/{name}.yaml", "-o", f"{out}/{name}"]) for name in names]
    if "batch" in sets:
        found.append(("batch", ["batch", str(folder / "batch"), "-o", f"{out}/batch/out", "--jobs", "1"]))
    return found


def main() -> int:
    """Run the comparison from the command line; return 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit")
    parser.add_argument("--sets", nargs="+", default=list(SETS), choices=SETS)
    parser.add_argument("--count", type=int, default=60, help="missions of each random set (terrain, everyday, turns)")
    parser.add_argument("--checks", type=int, default=300, help="files that are checked")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder, trees = Path(made), {"before": Path(made, "tree"), "now": REPOSITORY}
        trees["before"].mkdir()
        archive = subprocess.run(["git", "archive", arguments.commit], cwd=REPOSITORY, capture_output=True, check=True)
        subprocess.run(["tar", "-x", "-C", str(trees["before"])], input=archive.stdout, check=True)
        (folder / "missions").mkdir()
        (folder / "batch").mkdir()
        texts = dict(missions(arguments.sets, arguments.count))
        for name, text in texts.items():
            (folder / "missions" / f"{name}.yaml").write_text(text, encoding="utf-8")
        for number in range(13):
            text = yaml.safe_dump(draw(SEED + 1, number).document)
            (folder / "batch" / f"m{number}.yaml").write_text(text, encoding="utf-8")
        ended: dict[str, dict[str, str]] = {}
        for out, tree in trees.items():
            ended[out] = run(tree, folder, out, plans(arguments.sets, arguments.count, out, folder))
        given = list(checks(list(texts), folder / "before", arguments.checks))
        for out, tree in trees.items():
            ended[out] |= run(tree, folder, out, given)
        files, differ = 0, 0
        for name, code in ended["before"].items():
            before, now = compared(folder / "before" / name), compared(folder / "now" / name)
            files += len(before)
            wrong = differing(before, now)
            if code != ended["now"].get(name) or wrong:
                differ += 1
                print(f"{name}: exit {code} before, {ended['now'].get(name)} now; differ: {', '.join(wrong)}")
    count = len(ended["before"])
    print(
        f"{count} commands, {files} files of {arguments.commit}: {differ} commands differ; exit codes "
        + ", ".join(f"{c}: {list(ended['before'].values()).count(c)}" for c in sorted(set(ended["before"].values())))
    )
    return min(differ, 1)


if __name__ == "__main__":
    sys.exit(main())
