"""A package with one kernel, whose source changes under a test."""

from __future__ import annotations

import importlib
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.native import cache
from gcsplan.native.kernel_unit import KernelUnit, compilation_reported

SOURCE = """
from pathlib import Path

from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_reported

UNIT = KernelUnit("toy", Path(__file__).parent, "toys", ("weighing",))
FACTOR = {factor}


@UNIT.inlined
def times(value, factor):
    return value * factor


@UNIT.kernel("f8[,] f4[] i8[,,] b1[] f8 i8 b1 f8[]")
def weigh(a, b, c, d, x, k, whole, out):
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * (i + 1)
    for i in range(len(b)):
        total += b[i] / x
    if whole:
        for i in range(len(d)):
            if d[i]:
                total += c[i, 0, 1] * k
    out[0] = times(total, FACTOR)
    return c.shape[2] + k
"""


def expected(given: list[Any], factor: float = 1.0) -> float:
    a, b, c, d, x, k, whole, _ = given
    total = sum(a[i, j] * (i + 1) for i, j in itertools.product(*map(range, a.shape))) + sum(float(v) / x for v in b)
    return float((total + (sum(c[i, 0, 1] * k for i in range(len(d)) if d[i]) if whole else 0.0)) * factor)


def write(room: Path, factor: float) -> None:
    (room / "toys" / "weighing.py").write_text(SOURCE.format(factor=factor), encoding="utf-8")


def forget(package: str) -> None:
    for name in [m for m in sys.modules if m.split(".")[0] == package]:
        del sys.modules[name]
    importlib.invalidate_caches()


def imported_anew(name: str) -> Any:
    """A module, from its source as it stands."""
    forget(name.split(".")[0])
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    try:
        return importlib.import_module(name)
    finally:
        sys.dont_write_bytecode = before


def kernels(room: Path) -> KernelUnit:
    unit = imported_anew("toys.weighing").UNIT
    assert isinstance(unit, KernelUnit)
    assert unit.folder == room / "toys"
    return unit


MADE: dict[str, bytes] = {}
"""Bitcode by the source that it was made from, which takes longer than all else here."""


def ship(of: KernelUnit) -> None:
    digest = of.digest()
    assert digest is not None
    source = (of.shipped.parent / "weighing.py").read_text(encoding="utf-8")
    bitcode = MADE[source] = MADE.get(source) or of.bitcode_from_source()
    cache.write_shipped(of.shipped, digest, {}, bitcode)


def arguments() -> list[Any]:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 4)), rng.normal(size=5).astype(np.float32), rng.integers(-9, 9, (3, 2, 2))
    a.setflags(write=False)
    return [a, b, c, np.array([True, False, True]), 0.25, 7, True, np.zeros(1)]


def value(of: KernelUnit, factor: float = 1.0) -> float:
    given = arguments()
    assert of["weigh"](*given) == 2 + 7
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == pytest.approx(expected(given, factor), rel=1e-12)
    return float(out[0])


def notices(room: Path, factor: float = 1.0) -> list[str]:
    """The notices of compiling while the kernel, imported anew, is called, each without the unit's name."""
    found: list[str] = []
    with compilation_reported(found.append):
        value(kernels(room), factor)
    return [words.rpartition(":")[0] for words in found]
