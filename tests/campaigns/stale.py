"""Batches whose files, outputs and records change: do missions that they call done equal a new plan?

    python -m tests.campaigns.stale --seconds 120 [--seed 1] [--steps N]

A site is a few missions over files of random kinds (`tests.support.mission_inputs`) and a folder of results. Each step
changes something: a file that a mission reads (with a new time, or with its old one; cut, removed, added, put back), an
output (edited, deleted, exchanged, another plan written over it), a record (damaged, exchanged), or it kills a batch
before a random change to the disk. Then the batch runs again. The oracle knows which files were written for which
mission, and uses no list of gcsplan's: the missions that were touched must be planned anew, the others must not, and
every folder of results must equal what a new batch writes into an empty folder, with nothing remembered. Exits with 1,
and prints the seed and the step, if that fails.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gcsplan.app.batch import BatchOptions, MissionBatch, Record, missions_of
from gcsplan.app.parallel.executor import Inline
from gcsplan.errors import GcsplanError
from gcsplan.export.outdir import write_outputs
from gcsplan.world.terrain import input_files, raster
from tests.campaigns.disk import workshop
from tests.support.mission_inputs import CASES, Case, made, published

MISSIONS, STEPS = 3, 20
"""Missions of a site, and steps before the next site."""

MOST_CHANGES = 90
"""A batch is killed before one of so many changes to the disk, at most; a site makes about 60 for each mission."""

CODES = {0, 2, 3, 4}

NAMED_BY = {"far.ovr": "dem.tif.aux.xml"}
"""Files that are read only because another names them."""

Tree = dict[str, bytes]
Expected = tuple[int, Tree, list[dict[str, Any]]]
"""The code of a mission, its files, and its rows of the table."""


@dataclass
class Site:
    """Missions by name, the folder of their results, and what each should be."""

    root: Path
    rng: random.Random
    cases: dict[str, Case]
    expected: dict[str, Expected] = field(default_factory=dict)
    kept: dict[Path, bytes | None] = field(default_factory=dict)
    """The first content of each file; None: it was not there."""
    unsure: set[str] = field(default_factory=set)
    """Missions that may not read the changed file, since the file that names it has changed too."""

    @property
    def out(self) -> Path:
        """The folder of results."""
        return self.root / "out"

    def batch(self, out: Path) -> MissionBatch:
        """A batch of all missions into a folder."""
        return MissionBatch(missions_of([str(c.mission) for c in self.cases.values()]), out, BatchOptions())

    def files(self, name: str) -> list[Path]:
        """Every file that a mission reads or would read."""
        return [*self.cases[name].reads, *self.cases[name].absent]


def new_site(root: Path, rng: random.Random, kinds: list[str]) -> Site:
    """Missions of random kinds; one at most has a cache, for a process has one."""
    drawn = [rng.choice(kinds) for _ in range(MISSIONS)]
    for k in range(1, MISSIONS):
        while drawn[k] == published.__name__ and published.__name__ in drawn[:k] and len(kinds) > 1:
            drawn[k] = rng.choice(kinds)
    cases = {f"{kind}{k}/m": made(kind, root / "missions" / f"{kind}{k}") for k, kind in enumerate(drawn)}
    site = Site(root, rng, cases)
    cache = next((c.folder for n, c in cases.items() if n.startswith(published.__name__)), root)
    os.environ["GCSPLAN_DEM_CACHE"] = str(cache / "cache")
    for name in cases:
        for path in site.files(name):
            site.kept[path] = path.read_bytes() if path.exists() else None
    return site


# -- the steps: each returns the missions that must be planned anew ------------------------------------------------


def change_input(site: Site) -> set[str]:
    """A file that a mission reads, or would read."""
    name = site.rng.choice(sorted(site.cases))
    path = site.rng.choice(site.files(name))
    before = path.read_bytes() if path.exists() else None
    times = (path.stat().st_atime_ns, path.stat().st_mtime_ns) if path.exists() else None
    other = site.rng.choice([site.kept[path], _spoilt(before, site.rng), _spoilt(before, site.rng), None])
    if other == before:
        return set()
    if other is None:
        path.unlink()
    elif path.exists() and site.rng.random() < 0.3:  # as careful programs write, under a new inode
        part = path.with_name("part")
        part.write_bytes(other)
        os.replace(part, path)
    else:
        path.write_bytes(other)
    if other is not None and times is not None and site.rng.random() < 0.5:
        os.utime(path, ns=times)
    namer = path.with_name(NAMED_BY.get(path.name, path.name))
    if namer != path and (namer.read_bytes() if namer.exists() else None) != site.kept[namer]:
        site.unsure.add(name)
    return {name}


def _spoilt(data: bytes | None, rng: random.Random) -> bytes:
    if not data:
        return rng.choice([b"", b"new", b"<PAMDataset></PAMDataset>"])
    other = bytearray(data)
    if rng.random() < 0.2:
        return bytes(other[: rng.randrange(len(other))])
    for _ in range(rng.randint(1, 3)):
        other[rng.randrange(len(other))] ^= rng.randint(1, 255)
    return bytes(other)


def touch_others(site: Site) -> set[str]:
    """Files that no mission reads, and new times for the files that they read."""
    for name in site.cases:
        (site.cases[name].folder / "notes.txt").write_text(str(site.rng.random()))
        for path in site.files(name):
            if path.exists():
                os.utime(path, ns=(0, site.rng.randrange(10**18)))
    return set()


def change_output(site: Site) -> set[str]:
    """An output of a mission: edited, deleted, exchanged, or another plan's."""
    name, other = site.rng.choice(sorted(site.cases)), site.rng.choice(sorted(site.cases))
    folder, good = site.out / name, site.expected[name][0] == 0
    kind = site.rng.randrange(5)
    if kind == 0 or not good:
        write_outputs(folder, {"uav1.plan": "another plan's", "uav7.plan": "{}"})
        return {name}
    file = folder / site.rng.choice(sorted(site.expected[name][1]))
    if kind == 1:
        file.write_bytes(_spoilt(file.read_bytes(), site.rng) or b"edited")
    elif kind == 2:
        shutil.rmtree(folder)
    elif kind == 3 and other != name and (site.out / other).exists():
        shutil.copytree(site.out / other, folder, dirs_exist_ok=True)
    else:
        file.unlink()
    same = _tree(folder).items() >= site.expected[name][1].items()
    return set() if same else {name}


def change_record(site: Site) -> set[str]:
    """A record: cut, spoilt, exchanged with another's, deleted, or a folder in its place."""
    name, other = site.rng.choice(sorted(site.cases)), site.rng.choice(sorted(site.cases))
    file, their = (site.out / "records" / f"{n}.json" for n in (name, other))
    before = file.read_bytes()
    kind = site.rng.randrange(4)
    if kind == 0:
        file.unlink()
    elif kind == 1:
        file.write_bytes(their.read_bytes())
    elif kind == 2:
        file.write_bytes(
            site.rng.choice([b"[]", b"{}", b"null", b"[" * 99_999, b'{"format": 3, "body": 5}', before[:-1] * 2])
        )
    else:
        file.write_bytes(_spoilt(before, site.rng))
    # A byte that JSON does not mind (the space after a comma that became a tab) changes nothing in a record.
    return set() if _content(file) == _content_of(before) else {name}


def _content(file: Path) -> Any:
    return _content_of(file.read_bytes()) if file.is_file() else None


def _content_of(data: bytes) -> Any:
    import json

    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return data


def kill(site: Site) -> set[str]:
    """An input changes, and the batch is killed before a random change to the disk."""
    changed = change_input(site)
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        try:
            _die_before(site.out, site.rng.randint(1, MOST_CHANGES))
            _run(site.batch(site.out))
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    return changed


def _die_before(root: Path, number: int) -> None:
    """End this process by SIGKILL before its change to the disk of that number below ``root``."""
    left = number
    real_write = os.write

    def count() -> None:
        nonlocal left
        left -= 1
        if left <= 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def heard(event: str, arguments: tuple[Any, ...]) -> None:
        changes = event in ("os.rename", "os.remove", "os.mkdir", "os.rmdir")
        if event == "open" and isinstance(arguments[2], int):
            changes = bool(arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        if changes and str(root) in str(arguments[0]):
            count()

    def write(handle: int, data: Any) -> int:
        if left == 1:
            real_write(handle, bytes(data)[: len(data) // 2])
        count()
        return real_write(handle, data)

    os.write = write  # type: ignore[assignment]
    sys.addaudithook(heard)


STEPS_OF: dict[Callable[[Site], set[str]], int] = {
    change_input: 8, touch_others: 1, change_output: 4, change_record: 3, kill: 3,
}  # fmt: skip


# -- the run and its judgement -------------------------------------------------------------------------------------


def _run(batch: MissionBatch) -> tuple[dict[str, Record], set[str]]:
    """The records of all missions, and the names of the missions planned now."""
    with batch.alone():
        done, todo = batch.known()
        batch.run(Inline(), todo, done.append)
    return {r.mission: r for r in done}, {batch.missions[k][0] for k in todo}


def _tree(folder: Path) -> Tree:
    """The files of a plan."""
    if not folder.is_dir():
        return {}
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file() and p.name != ".gcsplan"}


def _afresh(site: Site) -> dict[str, Expected]:
    """Codes, files and rows of a new batch into an empty folder, with nothing remembered in this process."""
    remembered = (raster.remembered_headers, input_files.known_hashes, input_files.known_names)
    before: list[dict[Any, Any]] = [dict(one) for one in remembered]
    for one in remembered:
        one.clear()
    empty = site.root / "afresh"
    shutil.rmtree(empty, ignore_errors=True)
    records, _ = _run(site.batch(empty))
    for one, kept in zip(remembered, before, strict=True):
        one.clear()
        one.update(kept)  # type: ignore[arg-type]
    return {name: (r.code, _tree(empty / name), [dict(row) for row in r.rows]) for name, r in records.items()}


def judge(site: Site, touched: set[str], *, killed: bool) -> list[str]:
    """Run the batch again; return the faults of its outcome."""
    try:
        records, planned = _run(site.batch(site.out))
    except GcsplanError as why:
        return [f"the batch ends with {why}"]
    wrong = [f"{name} ends with {r.code}: {r.rows[0]['message']}" for name, r in records.items() if r.code not in CODES]
    if not killed:
        # A mission that failed may not have come to the file that changed: then only its result is compared.
        must = {name for name in touched - site.unsure if site.expected.get(name, (0,))[0] == 0}
        wrong += [f"{name} is called unchanged" for name in sorted(must - planned)]
        wrong += [f"{name} is planned again for nothing" for name in sorted(planned - touched)]
    site.unsure.clear()
    site.expected = _afresh(site)
    for name, (code, files, rows) in site.expected.items():
        found = _tree(site.out / name)
        if (records[name].code, [dict(row) for row in records[name].rows]) != (code, rows):
            wrong.append(f"{name} ends with {records[name].code}, {records[name].rows}, afresh with {code}, {rows}")
        # A file of others may lie beside a plan; a file that looks like an output may not.
        more = {n for n in found if n.endswith((".plan", ".waypoints", ".param", ".kml", ".geojson"))} - set(files)
        other = sorted(more | {n for n in files if found.get(n) != files[n]})
        if other:
            wrong.append(f"{name} is not what planning it now gives: {', '.join(other)}")
    if site.batch(site.out).known()[1]:
        wrong.append("a mission just done is not called done")
    return wrong


def campaign(
    seconds: float, seed: int, most_steps: int = sys.maxsize, kinds: list[str] | None = None, *, kills: bool = True
) -> tuple[Counter[str], list[str]]:
    """Attack until the time or the steps are over: how often each step was made, and all faults."""
    count: Counter[str] = Counter()
    found: list[str] = []
    until = time.monotonic() + seconds
    weights = {step: weight for step, weight in STEPS_OF.items() if kills or step is not kill}
    environment = os.environ.get("GCSPLAN_DEM_CACHE")
    try:
        while time.monotonic() < until and count.total() < most_steps and len(found) < 10:
            rng = random.Random(seed)
            with workshop() as root:
                site = new_site(root, rng, kinds or list(CASES))
                wrong = judge(site, set(site.cases), killed=False)
                found += [f"seed {seed}, at first: {what}" for what in wrong]
                for k in range(STEPS):
                    if time.monotonic() > until or count.total() >= most_steps or wrong:
                        break
                    (step,) = rng.choices(list(weights), list(weights.values()))
                    touched = step(site)
                    wrong = judge(site, touched, killed=step is kill)
                    count[step.__name__] += 1
                    found += [f"seed {seed}, step {k + 1} ({step.__name__}): {what}" for what in wrong]
            seed += 1
    finally:
        if environment is None:
            os.environ.pop("GCSPLAN_DEM_CACHE", None)
        else:
            os.environ["GCSPLAN_DEM_CACHE"] = environment
    return count, found


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=sys.maxsize)
    given = parser.parse_args()
    count, found = campaign(given.seconds, given.seed, given.steps)
    print("\n".join(found), end="\n" if found else "")
    print(f"{count.total()} steps, {len(found)} faults: {', '.join(f'{n} {name}' for name, n in count.most_common())}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
