"""Units of kernels: found again, never older than their source, and plain functions still."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, compilation_reported
from gcsplan.world.kernels.compiled import WORLD_UNIT
from tests.support.toy_kernels import imported_anew, kernels, notices, ship, value, write


def test_what_is_shipped_was_made_from_the_source_as_it_stands() -> None:
    made_of = json.loads(WORLD_UNIT.shipped.read_bytes().partition(b"\n")[0])["sources"]
    assert made_of == WORLD_UNIT.digest(), "run python -m gcsplan.native"


@pytest.mark.slow
def test_a_kernel_from_source_from_what_is_shipped_and_from_the_cache_is_the_same(room: Path) -> None:
    said: list[str] = []
    with compilation_reported(said.append):
        from_source = value(kernels(room))
        assert [words.startswith(SLOW_NOTICE) for words in said] == [True]
        ship(kernels(room))
        from_shipped = value(kernels(room))
        assert [words.startswith(QUICK_NOTICE) for words in said[1:]] == [True]
        assert value(kernels(room)) == from_shipped == from_source
        assert len(said) == 2  # the third was found in the cache


@pytest.mark.slow
def test_a_change_of_the_source_is_never_answered_with_older_code(room: Path) -> None:
    ship(kernels(room))
    assert notices(room) == [QUICK_NOTICE]
    write(room, 3.0)
    assert notices(room, 3.0) == [SLOW_NOTICE]
    assert notices(room, 3.0) == []


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize(
    "spoilt",
    [pytest.param(b"", marks=pytest.mark.slow), b"{}\n", pytest.param(b"not json\nx", marks=pytest.mark.slow), None],
)
def test_what_is_shipped_may_be_missing_or_spoilt(room: Path, spoilt: bytes | None) -> None:
    of = kernels(room)
    if spoilt is not None:
        of.shipped.write_bytes(spoilt)
    assert notices(room) == [SLOW_NOTICE]


def test_threads_that_come_at_once_get_the_same_code(room: Path) -> None:
    ship(kernels(room))
    of, found = kernels(room), []
    gate = threading.Barrier(4)

    def work() -> None:
        gate.wait(10.0)
        found.append(value(of))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30.0)
    assert len(found) == 4
    assert len(set(found)) == 1


MARKED = """
import math
from pathlib import Path

from {package}.{helper} import SCALE, longest
from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_reported

from {package}._unit import UNIT


@UNIT.device
def shorter(x, y):
    return min(longest(x, y), x * y) / SCALE


@UNIT.kernel("f8[] i4[] i1[] f8[]")
def fold(a, b, c, out):
    for i in range(len(a)):
        out[i] = shorter(a[i], b[i] + c[i])
"""

HELPER = """
from {package}._unit import UNIT

SCALE = {scale}


@UNIT.device
def longest(x, y):
    return math.sqrt(x * x + y * y) if x > 0.0 else SCALE * y


import math
"""

UNIT_OF = """
from pathlib import Path

from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_reported

UNIT = KernelUnit("marked", Path(__file__).parent, "{package}", ("_unit", "inner.helper", "marked"))
"""


def fold_of(room: Path, package: str, scale: float) -> Any:
    """The functions of a package with marked kernels, written anew."""
    folder = room / package
    (folder / "inner").mkdir(parents=True, exist_ok=True)
    files = {"__init__": "", "_unit": UNIT_OF, "inner/__init__": "", "inner/helper": HELPER, "marked": MARKED}
    for name, text in files.items():
        text = text.format(package=package, helper="inner.helper", scale=scale)
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return imported_anew(f"{package}.marked")


@pytest.mark.slow
def test_marked_functions_run_as_machine_code_and_are_plain_functions_still(room: Path) -> None:
    a, b, c = np.array([1.5, -2.0, 3.0]), np.array([4, 5, -6], np.int32), np.array([1, 2, 3], np.int8)
    for scale in (2.0, 0.5):  # the second time a constant in a module that the kernel's own imports has changed
        marked = fold_of(room, "marked_room", scale)
        quick, plain = np.zeros(3), np.zeros(3)
        assert marked.fold(a, b, c, quick) == 0
        marked.fold.__wrapped__(a, b, c, plain)
        assert quick.tolist() == plain.tolist()
        assert marked.shorter(3.0, 4.0) == 5.0 / scale
        with pytest.raises(TypeError):
            marked.fold(a, b.astype(np.int64), c, quick)


def test_two_kernels_of_one_name_are_refused(room: Path) -> None:
    marked = fold_of(room, "marked_twice", 1.0)
    with pytest.raises(ValueError, match="are called fold"):
        marked.UNIT.kernel("f8")(marked.fold.__wrapped__)
