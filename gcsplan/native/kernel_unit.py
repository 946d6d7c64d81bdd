"""Kernels written as plain functions and marked as such; their machine code is found or made at the first call.

    UNIT = KernelUnit("planners", Path(__file__).parent, "gcsplan.planners", ("lattice.search_kernels",))

    @UNIT.device
    def inner(x, y): ...

    @UNIT.kernel("f8[,] i8 f8[]")
    def outer(a, k, out): ...      # fills arrays; returns an int or nothing (0)

`outer` is then called with arrays of exactly these forms (see `gcsplan.native.signature`), and runs as machine code.
numba is imported only if the machine code must be compiled from source.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import importlib
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from gcsplan.native import cache
from gcsplan.native.llvm import HostMachine
from gcsplan.native.signature import Held, read_forms, slots_of

CALLING_CONVENTION = "2"
"""Version of the calling convention of kernels."""

_listeners: list[Callable[[str], None]] = []

QUICK_NOTICE = "compiling the kernels for this machine (once, about a second)"
SLOW_NOTICE = "compiling the kernels from source (once, up to two minutes)"

KernelFunction = TypeVar("KernelFunction", bound=Callable[..., Any])


class KernelUnit:
    """Kernels in some modules of a package that are compiled together.

    ``folder``: the package's folder; ``modules``: all modules that hold a marked function or a constant that one uses,
    as dotted names within ``package``; ``more``: further files in the folder that they depend on. ``vectors``: loops
    over arrays are vectorised before they are shipped, sums in an order that is then fixed; no argument of a function
    may be a view of another's array.
    """

    def __init__(
        self,
        name: str,
        folder: Path,
        package: str,
        modules: tuple[str, ...],
        more: tuple[str, ...] = (),
        *,
        vectors: bool = False,
    ) -> None:
        self.name = name
        self.folder = folder
        self.sources = tuple(folder / file for file in (*(f"{m.replace('.', '/')}.py" for m in modules), *more))
        self.vectors = vectors
        self.forms: dict[str, str] = {}
        self._modules = tuple(f"{package}.{m}" for m in modules)
        self._plain: dict[int, Callable[..., Any]] = {}
        self._inlined: set[int] = set()
        self._kernels: dict[str, Callable[..., Any]] = {}
        self._lock = threading.Lock()
        self._loaded: dict[str, Callable[..., int]] | None = None

    def device(self, function: KernelFunction) -> KernelFunction:
        """Mark a function that kernels call. Python can call it too, as a plain function."""
        self._plain[id(function)] = function
        return function

    def inlined(self, function: KernelFunction) -> KernelFunction:
        """The same for a function with one caller, into which it is copied: a sixth of the exact check's speed."""
        self._inlined.add(id(function))
        return self.device(function)

    def kernel(self, forms: str) -> Callable[[Callable[..., Any]], Callable[..., int]]:
        """Mark a function that Python calls as machine code; the plain one is its ``__wrapped__``."""
        read_forms(forms)

        def mark(function: Callable[..., Any]) -> Callable[..., int]:
            name = function.__name__
            if name in self._kernels:
                raise ValueError(f"two kernels of {self.name} are called {name}")

            @functools.wraps(function)
            def call(*arguments: Any) -> int:
                return self[name](*arguments)

            self.forms[name] = forms
            self._kernels[name] = function
            self._plain[id(function)] = self._plain[id(call)] = function
            return call

        return mark

    @property
    def shipped(self) -> Path:
        """The file with the intermediate form."""
        return self.folder / f"{self.name}{cache.SHIPPED_SUFFIX}"

    def digest(self) -> str | None:
        """The digest of everything that the intermediate form depends on; None if the sources cannot be read."""
        for module in self._modules:  # so that every kernel is known
            importlib.import_module(module)
        return cache.digest_of(self.sources, repr((CALLING_CONVENTION, sorted(self.forms.items()))))

    def __getitem__(self, name: str) -> Callable[..., int]:
        """The kernel of that name; called with arrays and numbers in its forms. Raises TypeError for others."""
        if self._loaded is None:
            with self._lock:
                if self._loaded is None:
                    self._loaded = self._load()
        return self._loaded[name]

    def forget(self) -> None:
        """Let the next call load the machine code anew, for what the processor can do by then."""
        with self._lock:
            self._loaded = None

    def with_numba(self) -> dict[str, Any]:
        """The kernels as functions of numba by name, for code that numba compiles together with them."""
        self.digest()
        source = importlib.import_module("gcsplan.native.compile")
        return dict(source.with_numba(self._kernels, self._plain, self._inlined, vectors=self.vectors))

    def bitcode_from_source(self) -> bytes:
        """The intermediate form, made by numba here and now."""
        source = importlib.import_module("gcsplan.native.compile")
        kernels = {name: (function, read_forms(self.forms[name])) for name, function in self.with_numba().items()}
        return bytes(source.bitcode(kernels, vectors=self.vectors))

    def _load(self) -> dict[str, Callable[..., int]]:
        machine = HostMachine()
        digest = self.digest()
        shipped = cache.read_shipped(self.shipped, digest)
        made_of = hashlib.sha256(shipped).hexdigest() if shipped is not None else f"source {digest}"
        key = hashlib.sha256("\0".join((CALLING_CONVENTION, made_of, *machine.marks)).encode()).hexdigest()
        kept_as = cache.name_of_code(self.name, key)
        code = cache.read_kept(kept_as)
        if code is None:
            code = self._compile(machine, shipped)
            cache.keep(kept_as, code)
        addresses = machine.link(code, tuple(self.forms))
        return {name: _callable(name, addresses[name], text) for name, text in self.forms.items()}

    def _compile(self, machine: HostMachine, shipped: bytes | None) -> bytes:
        """Machine code, from the shipped form if that can be read."""
        if shipped is not None:
            with _compiling(self.name, quick=True):
                code = machine.compile(shipped)
            if code is not None:
                return code
        with _compiling(self.name, quick=False):
            code = machine.compile(self.bitcode_from_source())
        if code is None:
            raise RuntimeError(f"LLVM does not read what numba made of the kernels of {self.name}")
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


# -- notices that kernels are being compiled ------------------------------------------------------------------------


@contextmanager
def compilation_reported(listener: Callable[[str], None]) -> Iterator[None]:
    """In this context ``listener`` is called with a sentence before kernels are compiled; never if they are cached."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def _compiling(name: str, *, quick: bool) -> Iterator[None]:
    """Report that the kernels ``name`` are compiled now."""
    for listener in tuple(_listeners):
        listener(f"{QUICK_NOTICE if quick else SLOW_NOTICE}: {name}")
    yield
