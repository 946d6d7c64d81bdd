"""Kernels that Python calls; their machine code is found or made at the first call."""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import struct
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gcsplan.native import notice, shelf
from gcsplan.native.form import Held, read_forms, slots_of
from gcsplan.native.machine import Machine

FORMAT = "2"
"""Version of the calling convention of kernels."""


class Kernels:
    """Kernels that are compiled together.

    ``folder``: the folder of their source; ``sources``: names of all files that they are made from; ``forms``: by the
    name of each kernel, the forms of its arguments (`read_forms`); a kernel returns an int; ``module``: the dotted name
    of the module that holds numba functions of these names, imported only if they must be compiled from source.
    """

    def __init__(
        self, name: str, folder: Path, sources: tuple[str, ...], module: str, forms: Mapping[str, str]
    ) -> None:
        self.name = name
        self.folder = folder
        self.sources = tuple(folder / source for source in sources)
        self.module = module
        self.forms = dict(forms)
        self._lock = threading.Lock()
        self._loaded: dict[str, Callable[..., int]] | None = None

    @property
    def shipped(self) -> Path:
        """The file with the intermediate form."""
        return self.folder / f"{self.name}{shelf.SUFFIX}"

    def digest(self) -> str | None:
        """The digest of everything that the intermediate form depends on; None if the sources cannot be read."""
        return shelf.digest_of(self.sources, repr((FORMAT, sorted(self.forms.items()))))

    def __getitem__(self, name: str) -> Callable[..., int]:
        """The kernel of that name; called with arrays and numbers in its forms. Raises TypeError for others."""
        if self._loaded is None:
            with self._lock:
                if self._loaded is None:
                    self._loaded = self._load()
        return self._loaded[name]

    def bitcode_from_source(self) -> bytes:
        """The intermediate form, made by numba here and now."""
        source = importlib.import_module("gcsplan.native.source")
        functions = importlib.import_module(self.module)
        return bytes(
            source.bitcode({name: (getattr(functions, name), read_forms(text)) for name, text in self.forms.items()})
        )

    def _load(self) -> dict[str, Callable[..., int]]:
        machine = Machine()
        digest = self.digest()
        shipped = shelf.read_shipped(self.shipped, digest)
        made_of = hashlib.sha256(shipped).hexdigest() if shipped is not None else f"source {digest}"
        key = hashlib.sha256("\0".join((FORMAT, made_of, *machine.marks)).encode()).hexdigest()
        kept_as = shelf.name_of_code(self.name, key)
        code = shelf.read_kept(kept_as)
        if code is None:
            code = self._compile(machine, shipped)
            shelf.keep(kept_as, code)
        addresses = machine.link(code, tuple(self.forms))
        return {name: _callable(name, addresses[name], text) for name, text in self.forms.items()}

    def _compile(self, machine: Machine, shipped: bytes | None) -> bytes:
        """Machine code, from the shipped form if that can be read."""
        if shipped is not None:
            with notice.compiling(self.name, quick=True):
                code = machine.compile(shipped)
            if code is not None:
                return code
        with notice.compiling(self.name, quick=False):
            code = machine.compile(self.bitcode_from_source())
        if code is None:
            raise RuntimeError(f"LLVM does not read what numba made of {self.module}")
        return code


def _callable(name: str, address: int, text: str) -> Callable[..., int]:
    """A Python function that passes its arguments to machine code at ``address``."""
    forms = read_forms(text)
    pack = struct.Struct("=" + "".join(form.slots for form in forms)).pack
    # numba's own convention: address for the result, address for an exception, then the arguments; status 0 is success.
    raw = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(address)

    def call(*arguments: Any) -> int:
        slots: list[Any] = []
        at = 0
        for argument in arguments:
            if type(argument) is Held:
                after = at + len(argument.forms)
                if forms[at:after] != argument.forms:
                    raise TypeError(f"{name} takes other arguments from its {at + 1}. on")
                slots += argument.slots
                at = after
            elif at < len(forms) and forms[at].dimensions:
                slots += slots_of(forms[at], argument)
                at += 1
            else:
                slots.append(argument)
                at += 1
        if at != len(forms):
            raise TypeError(f"{name} takes {len(forms)} arguments, given {at}")
        result, excuse = ctypes.c_int64(), ctypes.c_void_p()
        status = raw(ctypes.byref(result), ctypes.byref(excuse), pack(*slots))
        if status:
            raise RuntimeError(f"{name} failed with status {status}")
        return result.value

    return call
