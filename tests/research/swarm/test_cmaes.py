"""CMA-ES by the package ``cma``: it does what the package does alone, all randomness is the run's, it is optional."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.swarm.cmaes import ENTRY

DIM = 6
MIDDLE = np.linspace(0.2, 0.8, DIM)


def sphere(x: Floats) -> Floats:
    return np.asarray(((x - MIDDLE) ** 2).sum(axis=1))


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(InputError, match=r"pip install 'gcsplan\[bench\]'"):
        minimise(ENTRY, sphere, DIM)


def test_it_evaluates_what_the_package_alone_evaluates() -> None:
    cma = pytest.importorskip("cma")
    seen: list[Floats] = []

    def noted(x: Floats) -> Floats:
        seen.append(x.copy())
        return sphere(x)

    minimise(ENTRY, noted, DIM, population=12, iterations=40, seed=5)
    rng = np.random.default_rng(5)
    options = {"popsize": 12, "bounds": [0, 1], "seed": np.nan, "verbose": -9,
               "randn": lambda *shape: rng.standard_normal(shape)}  # fmt: skip
    search = cma.CMAEvolutionStrategy(np.full(DIM, 0.5), 0.3, options)
    wanted = []
    for _ in range(41):
        asked = search.ask()
        search.tell(asked, [float(sphere(np.array([x]))[0]) for x in asked])
        wanted += asked
    np.testing.assert_allclose(np.concatenate(seen), wanted, atol=1e-12)


def test_the_same_seed_gives_the_same_bytes_and_leaves_numpys_own_generator_alone() -> None:
    pytest.importorskip("cma")
    before = np.random.get_state()[1].tobytes()  # type: ignore[index, union-attr]  # noqa: NPY002
    runs = [minimise(ENTRY, sphere, DIM, evaluations=1500, seed=s) for s in (1, 1, 2)]
    assert runs[0].x.tobytes() == runs[1].x.tobytes() != runs[2].x.tobytes()
    assert runs[0].cost < 1e-7
    assert np.random.get_state()[1].tobytes() == before  # type: ignore[index, union-attr]  # noqa: NPY002


def test_it_begins_again_with_more_members_when_it_has_converged() -> None:
    pytest.importorskip("cma")
    result = minimise(ENTRY, sphere, DIM, population=10, evaluations=8000, seed=1)
    sizes = np.diff(result.history.evaluations)
    assert sizes[0] == 10
    assert 20 in sizes.tolist()
    assert result.evaluations == 8000


def test_it_begins_at_the_start_points_it_is_given() -> None:
    pytest.importorskip("cma")
    seen: list[Floats] = []

    def noted(x: Floats) -> Floats:
        seen.append(x.copy())
        return sphere(x)

    minimise(ENTRY, noted, DIM, population=30, iterations=1, seed=1, start=MIDDLE[None])
    assert np.abs(seen[0].mean(axis=0) - MIDDLE).max() < 0.05
