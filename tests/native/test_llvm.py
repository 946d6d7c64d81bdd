"""LLVM of this machine reads what is shipped, or the source is compiled."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.native import cache
from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE
from gcsplan.native.llvm import HostMachine
from gcsplan.world.kernels.compiled import WORLD_UNIT
from tests.support.toy_kernels import kernels, notices


@pytest.mark.nightly
def test_this_llvm_reads_what_is_shipped() -> None:
    bitcode = cache.read_shipped(WORLD_UNIT.shipped, WORLD_UNIT.digest())
    assert bitcode is not None
    code = HostMachine().compile(bitcode)
    assert code is not None
    assert set(HostMachine().link(code, tuple(WORLD_UNIT.forms))) == {"judge", "pieces", "around", "local_extrema"}


@pytest.mark.slow
def test_bitcode_that_this_llvm_cannot_read_is_made_anew_from_source(room: Path) -> None:
    of = kernels(room)
    digest = of.digest()
    assert digest is not None
    cache.write_shipped(of.shipped, digest, {}, b"BC\xc0\xde from the future")
    assert notices(room) == [QUICK_NOTICE, SLOW_NOTICE]
