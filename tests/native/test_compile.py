"""From plain functions to bitcode: options that this numba knows, and what a kernel may give back."""

from __future__ import annotations

import pytest
from llvmlite import binding

from gcsplan.native import compile as native
from gcsplan.native.signature import read_forms


def summed(values, count, out):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(count):
        total += doubled(values[k])
    out[0] = total
    return count


def doubled(value):  # type: ignore[no-untyped-def]
    return 2.0 * value


def halved(value):  # type: ignore[no-untyped-def]
    return 0.5 * value


def test_options_that_this_numba_does_not_know_are_left_out() -> None:
    assert native.options(nogil=True, not_an_option=True) == {"nogil": True}


@pytest.mark.nightly
def test_bitcode_holds_a_function_of_each_kernels_name_and_hides_the_others() -> None:
    twins = native.with_numba({"summed": summed}, {id(f): f for f in (summed, doubled)}, set())
    assert set(twins) == {"summed"}
    module = binding.parse_bitcode(native.bitcode({"summed": (twins["summed"], read_forms("f8[] i8 f8[]"))}))
    seen = {f.name for f in module.functions if not f.is_declaration and f.linkage.name != "internal"}
    assert seen == {"summed"}


def test_a_kernel_that_gives_back_a_fraction_is_refused() -> None:
    twins = native.with_numba({"halved": halved}, {id(halved): halved}, set())
    with pytest.raises(native.TypingError, match="a kernel gives back an int or nothing"):
        native.bitcode({"halved": (twins["halved"], read_forms("f8"))})
