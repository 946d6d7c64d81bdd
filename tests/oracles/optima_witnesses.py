"""Good paths from earlier patient searches, stored with the tests: each bounds its mission's optimum from above.

`known` returns a stored path only if it passes the exact check on the mission as it is made today.
``python -m tests.oracles.optima_witnesses --seeds 0 50`` searches again and stores every cheaper path.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.planners.optimal.planner import plan
from tests.oracles.optima_polish import PATIENT, cost_of, is_feasible, polish, simplify
from tests.oracles.optima_search import best_path
from tests.oracles.optima_worlds import FAMILIES, VOIDS, Case, make
from tests.support.paths import DATA

FILE = DATA / "witnesses.npz"


@cache
def kept() -> Mapping[tuple[str, int], Floats]:
    """All stored paths, by family and seed."""
    out = {}
    if FILE.exists():
        with np.load(FILE) as file:
            for family in file.files:
                if "/" in family:
                    continue
                numbers, counts = file[f"{family}/seeds"], file[f"{family}/counts"]
                parts = np.split(file[family], np.cumsum(counts)[:-1])
                out.update({(family, int(n)): part for n, part in zip(numbers, parts, strict=True)})
    return out


def known(family: str, seed: int, case: Case) -> Floats | None:
    """The path stored for a mission if it is legal there, else None.

    With voids in the ground, it is the path stored for the mission without them, if the exact check passes it there
    too: such a witness comes from nothing that has ever seen a void.
    """
    points = kept().get((family.removesuffix(VOIDS), seed))
    return points if points is not None and is_feasible(case.problem, points) else None


def search(family: str, seed: int) -> Floats | None:
    """The cheapest of three paths: the stored one, a patient search's, and the planner's own after polishing."""
    case = make(family, seed)
    p = case.problem
    found = [known(family, seed, case), best_path(p, seed, PATIENT)]
    try:
        rng = np.random.default_rng(seed)
        found.append(polish(p, np.array(plan(p).path.points), rng, PATIENT, widest=0.01))
    except NoMission:
        pass
    legal = [way for way in found if way is not None and is_feasible(p, way)]
    return simplify(p, min(legal, key=lambda way: cost_of(p, way))) if legal else None


def write(paths: Mapping[tuple[str, int], Floats]) -> None:
    """Write all paths to the file."""
    out: dict[str, NDArray[np.generic]] = {}
    for family in FAMILIES:
        numbers = sorted(seed for name, seed in paths if name == family)
        if numbers:
            out[family] = np.vstack([paths[family, n] for n in numbers])
            out[f"{family}/seeds"] = np.array(numbers, np.int32)
            out[f"{family}/counts"] = np.array([len(paths[family, n]) for n in numbers], np.int32)
    np.savez_compressed(FILE, **out)  # type: ignore[arg-type]


def main() -> None:
    """Search for witnesses from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 50), metavar=("FIRST", "LAST"))
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    given = parser.parse_args()
    paths = dict(kept())
    for family in given.families:
        for seed in range(*given.seeds):
            found = search(family, seed)
            if found is not None:
                paths[family, seed] = found
        write(paths)
        print(family, sum(name == family for name, _ in paths), FILE.stat().st_size, flush=True)


if __name__ == "__main__":
    main()
