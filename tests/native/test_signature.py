"""Arguments of kernels: of the right form, held for many calls, or refused."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gcsplan.native.signature import Held, read_forms
from tests.support.toy_kernels import arguments, expected, kernels, ship, value


@pytest.mark.slow
def test_only_arguments_of_the_right_form_reach_machine_code(room: Path) -> None:
    ship(kernels(room))
    weigh = kernels(room)["weigh"]
    good = arguments()
    bad: list[tuple[int, object]] = [
        (0, np.zeros((3, 4), np.float32)),
        (0, np.zeros(4)),
        (0, np.zeros((4, 3)).T),
        (1, np.zeros(5)),
        (2, np.zeros((3, 2, 2), np.int32)),
        (3, np.zeros(3, np.int8)),
        (7, np.zeros(2)[::-1]),
    ]
    for place, wrong in bad:
        with pytest.raises(TypeError):
            weigh(*[wrong if k == place else a for k, a in enumerate(good)])
    for count in (7, 9):
        with pytest.raises(TypeError, match="takes 8 arguments"):
            weigh(*(good + good)[:count])


def test_held_arguments_stand_in_for_their_own_form_alone(room: Path) -> None:
    ship(kernels(room))
    of = kernels(room)
    weigh, given = of["weigh"], arguments()
    held = Held("f4[] i8[,,] b1[]", *given[1:4])
    weigh(given[0], held, *given[4:])
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == value(of)
    with pytest.raises(TypeError, match=r"from its 1\. on"):
        weigh(held, *given[3:])
    with pytest.raises(TypeError, match=r"from its 8\. on"):
        weigh(*given[:7], held)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda held: pickle.loads(pickle.dumps(held))])
def test_a_copy_of_held_arguments_has_addresses_of_its_own(room: Path, copied: Callable[[Held], Held]) -> None:
    ship(kernels(room))
    of, given = kernels(room), arguments()
    twin = copied(Held("f8[,] f4[] i8[,,] b1[]", *given[:4]))
    of["weigh"](twin, *given[4:])
    assert given[-1][0] == value(of)
    assert [twin.slots[k] for k in (0, 3, 5, 9)] == [a.ctypes.data for a in twin.arguments]
    assert twin.slots[0] != given[0].ctypes.data


def test_empty_arrays_are_arguments_too(room: Path) -> None:
    ship(kernels(room))
    given = arguments()
    given[0], given[1] = np.zeros((0, 4)), np.zeros(0, np.float32)
    kernels(room)["weigh"](*given)
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == pytest.approx(expected(given))


@pytest.mark.parametrize("words", ["f2", "f8[", "f8[,,,]", "f4", "[]", "x8[,]"])
def test_other_forms_are_refused(words: str) -> None:
    with pytest.raises(ValueError, match="a form is"):
        read_forms(words)
