"""The forms of kernels' arguments: what Python passes, and the slots of eight bytes that machine code takes."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

DTYPES: dict[str, np.dtype[Any]] = {
    "f8": np.dtype(np.float64),
    "f4": np.dtype(np.float32),
    "i8": np.dtype(np.int64),
    "i4": np.dtype(np.int32),
    "i1": np.dtype(np.int8),
    "b1": np.dtype(np.bool_),
}
_DIMENSIONS = {"": 0, "[]": 1, "[,]": 2, "[,,]": 3}
_ARRAYS_ONLY = {"f4", "i4", "i1"}
_address_of = ctypes.addressof
_over = ctypes.c_char.from_buffer


@dataclass(frozen=True, slots=True)
class ArgumentForm:
    """One argument: a number (``dimensions`` 0) or a C-contiguous array. ``letters``: f8, f4, i8, i4, i1 or b1."""

    letters: str
    dimensions: int

    @property
    def slots(self) -> str:
        """The format for `struct`: a number in one slot, an array as its address and its lengths."""
        if self.dimensions:
            return "Q" + self.dimensions * "q"
        return "d" if self.letters == "f8" else "q"


@functools.cache
def read_forms(text: str) -> tuple[ArgumentForm, ...]:
    """Forms from words such as ``f8`` (a number), ``f8[]``, ``f8[,]``, ``f8[,,]`` (arrays)."""
    forms = []
    for word in text.split():
        letters, shape = word[:2], word[2:]
        if letters not in DTYPES or shape not in _DIMENSIONS or word in _ARRAYS_ONLY:
            raise ValueError(
                f"a form is f8, i8 or b1, or an array of these, f4, i4 or i1, such as f8[,], given {word!r}"
            )
        forms.append(_form(letters, _DIMENSIONS[shape]))
    return tuple(forms)


@functools.cache
def _form(letters: str, dimensions: int) -> ArgumentForm:
    """One object for each form, so that tuples of forms are compared by identity, at every call of a kernel."""
    return ArgumentForm(letters, dimensions)


def slots_of(form: ArgumentForm, argument: Any) -> tuple[Any, ...]:
    """The contents of the slots of one argument. Raises TypeError if an array does not have the form.

    For an array this is its address: whoever holds the slots must hold the array.
    """
    if not form.dimensions:
        return (argument,)
    if argument.dtype != DTYPES[form.letters] or argument.ndim != form.dimensions or not argument.flags.c_contiguous:
        raise TypeError(
            f"a kernel wants a contiguous array of {form.letters} in {form.dimensions} dimensions, given "
            f"{argument.dtype.str[1:]} in {argument.ndim}{'' if argument.flags.c_contiguous else ', not contiguous'}"
        )
    if not argument.size:
        return (0, *argument.shape)
    # The fast way to an address works only for writable arrays.
    address = _address_of(_over(argument)) if argument.flags.writeable else argument.ctypes.data
    return (address, *argument.shape)


class Held:
    """Arguments whose slots are prepared once, for many calls; an instance is passed in place of those arguments."""

    __slots__ = ("arguments", "forms", "slots", "text")

    def __init__(self, forms: str, *arguments: Any) -> None:
        self.text = forms
        self.forms = read_forms(forms)
        self.arguments = arguments
        self.slots = [
            slot for form, argument in zip(self.forms, arguments, strict=True) for slot in slots_of(form, argument)
        ]

    def __reduce__(self) -> tuple[type[Held], tuple[Any, ...]]:
        """Pickle forms and arguments: a copy, in this or another process, has its own arrays and their addresses."""
        return Held, (self.text, *self.arguments)
