"""The unit of the kernels of turns lists every module that its machine code depends on."""

from __future__ import annotations

from gcsplan.planners.turns import compiled
from tests.support.kernel_sources import faults


def test_the_unit_of_turns_lists_all_its_modules() -> None:
    assert faults(compiled, compiled.TURNS_UNIT) == []


def test_it_is_separate_from_the_planners_so_that_a_copter_loads_no_turns() -> None:
    from gcsplan.planners.compiled import PLANNERS_UNIT

    assert compiled.TURNS_UNIT.name != PLANNERS_UNIT.name
    assert not set(compiled.TURNS_UNIT.sources) & set(PLANNERS_UNIT.sources)
