"""Plan the same missions with another commit and with this tree, and compare all files byte by byte.

    python -m tests.campaigns.same_bytes COMMIT [--sets gallery papers terrain everyday] [--count 60]

For changes that move or rename code and must not change any output. It compares the exit code and every `.waypoints`,
`.plan`, CSV, JSON and GeoJSON of ``gcsplan plan``, but not messages and pictures. Prints the missions that differ and
exits with 1 if there are any.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import yaml

from gcsplan.bench.everyday_missions import KINDS, draw
from tests.support.paths import MISSIONS, REPOSITORY

SETS = ("gallery", "papers", "terrain", "everyday")
COMPARED = (".waypoints", ".plan", ".csv", ".json", ".geojson")
SEED = 77
MOST_S = 3600.0
"""Seconds that each tree may take for all missions."""

PLAN = """
import contextlib, importlib, io, sys
try:
    main = importlib.import_module("gcsplan.cli.main").main
except ModuleNotFoundError:  # before the command line was a package
    main = importlib.import_module("gcsplan.cli").main
out = sys.argv[1]
for name in open("missions.txt").read().split():
    sys.argv = ["gcsplan", "plan", f"missions/{name}.yaml", "-o", f"{out}/{name}"]
    code = 0
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            main()
        except SystemExit as ended:
            code = ended.code or 0
    print(name, code, flush=True)
"""


def missions(sets: list[str], count: int) -> Iterator[tuple[str, str]]:
    """Name and text of each mission file."""
    folders = {"gallery": MISSIONS, "papers": MISSIONS / "papers"}
    for which in sets:
        if which in folders:
            for file in sorted(folders[which].glob("*.yaml")):
                yield f"{which}-{file.stem}", file.read_text(encoding="utf-8")
        else:
            for k in range(count):
                number = len(KINDS) * k + KINDS.index("sample") if which == "terrain" else k
                yield f"{which}-{number}", yaml.safe_dump(draw(SEED, number).document)


def planned(tree: Path, folder: Path, out: str) -> dict[str, str]:
    """Plan all missions with the code of ``tree``, into ``folder/out``; return the exit code of each."""
    (folder / out).mkdir()
    env = os.environ | {"PYTHONPATH": str(tree)}
    with (folder / f"{out}.log").open("w", encoding="utf-8") as log:
        ended = subprocess.run(
            [sys.executable, "-c", PLAN, out], cwd=folder, env=env, stdout=log, timeout=MOST_S, check=False
        )
    if ended.returncode:
        raise SystemExit(f"{tree}: the process that plans ended with {ended.returncode}")
    lines = (folder / f"{out}.log").read_text(encoding="utf-8").splitlines()
    return dict(line.split(" ", 1) for line in lines)


def files(folder: Path) -> dict[str, bytes]:
    """The files below a folder that are compared, by name."""
    found = (p for p in sorted(folder.rglob("*")) if p.suffix in COMPARED and p.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in found}


def main() -> int:
    """Run the comparison from the command line; return 1 if any mission differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit")
    parser.add_argument("--sets", nargs="+", default=list(SETS), choices=SETS)
    parser.add_argument("--count", type=int, default=60, help="missions of each random set (terrain, everyday)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        other = folder / "tree"
        other.mkdir()
        archive = subprocess.run(["git", "archive", arguments.commit], cwd=REPOSITORY, capture_output=True, check=True)
        subprocess.run(["tar", "-x", "-C", str(other)], input=archive.stdout, check=True)
        texts = dict(missions(arguments.sets, arguments.count))
        (folder / "missions").mkdir()
        for name, text in texts.items():
            (folder / "missions" / f"{name}.yaml").write_text(text, encoding="utf-8")
        (folder / "missions.txt").write_text("\n".join(texts), encoding="utf-8")
        before, after = planned(other, folder, "before"), planned(REPOSITORY, folder, "after")
        compared, differ = 0, []
        for name in texts:
            a, b = files(folder / "before" / name), files(folder / "after" / name)
            compared += len(a)
            changed = sorted(k for k in a.keys() | b.keys() if a.get(k) != b.get(k))
            if before.get(name) != after.get(name) or changed:
                differ.append(name)
                print(f"{name}: exit {before.get(name)} before, {after.get(name)} now; differ: {', '.join(changed)}")
        print(f"{len(texts)} missions, {compared} files of {arguments.commit}: {len(differ)} missions differ")
        shutil.rmtree(other)
    return min(len(differ), 1)


if __name__ == "__main__":
    sys.exit(main())
