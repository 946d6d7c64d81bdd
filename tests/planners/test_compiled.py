"""The unit of the planners' kernels lists every module that its machine code depends on."""

from __future__ import annotations

from gcsplan.planners import compiled
from tests.support.kernel_sources import faults


def test_the_unit_of_the_planners_lists_all_its_modules() -> None:
    assert faults(compiled, compiled.PLANNERS_UNIT) == []


def test_every_listed_file_is_there_once() -> None:
    sources = compiled.PLANNERS_UNIT.sources
    assert all(path.is_file() for path in sources)
    assert len(set(sources)) == len(sources)
