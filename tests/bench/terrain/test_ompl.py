"""The exact check of one leg, and what is said where OMPL is missing."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from gcsplan.bench.terrain import ompl
from gcsplan.bench.terrain import run as terrain
from gcsplan.bench.terrain.problems import NamedProblem
from gcsplan.errors import InputError

pytestmark = pytest.mark.slow


@pytest.mark.nightly
def test_the_check_of_one_leg_is_the_airspaces_own(main: list[NamedProblem]) -> None:
    p = main[48].problem
    names = ompl.KERNEL_ARGUMENTS
    arguments = ompl.kernel_arguments(p.airspace, p.limits)
    assert len(names) == len(arguments)
    place = {name: arguments[i] for i, name in enumerate(names)}
    assert place["ground"] is p.airspace.surface.ground_m
    assert (place["start"].shape, place["ok"].shape, place["seen"].shape) == ((1, 3), (1,), (40,))
    assert place["max_amsl_m"] == p.limits.max_amsl_m


def test_a_rival_that_is_not_installed_is_named_with_the_cure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(ompl, "version", missing)
    with pytest.raises(InputError, match=r"gcsplan\[bench\]"):
        terrain.run(tmp_path, kinds=["main"], runs=1, count=1)
    assert list(tmp_path.iterdir()) == []
