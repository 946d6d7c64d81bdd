"""`python -m gcsplan.native`: the units that it makes, and words for what it does not know."""

from __future__ import annotations

import pytest

from gcsplan.native.__main__ import KERNEL_UNITS, kernel_unit, main


@pytest.mark.parametrize("name", KERNEL_UNITS)
def test_each_name_is_that_of_a_unit_with_a_shipped_form(name: str) -> None:
    unit = kernel_unit(name)
    assert unit.name == name
    assert unit.shipped.name == f"{name}.kernels"
    assert unit.shipped.is_file()


def test_an_unknown_name_ends_with_the_known_ones() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["world", "wrold"])
    assert str(ended.value) == (
        "usage: python -m gcsplan.native [world | planners | swarm | turns] …: without a name, all of them"
    )
