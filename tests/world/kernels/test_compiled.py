"""The unit of the exact check's kernels lists every module that its machine code depends on."""

from __future__ import annotations

from gcsplan.world.kernels import compiled
from tests.support.kernel_sources import faults


def test_the_unit_of_the_exact_check_lists_all_its_modules() -> None:
    assert faults(compiled, compiled.WORLD_UNIT) == []


def test_every_listed_file_is_there_once() -> None:
    sources = compiled.WORLD_UNIT.sources
    assert all(path.is_file() for path in sources)
    assert len(set(sources)) == len(sources)
