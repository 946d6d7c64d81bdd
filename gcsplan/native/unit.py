"""Kernels written as plain functions and marked as such; numba is imported only if they must be compiled.

    UNIT = Unit("planners", Path(__file__).parent, "gcsplan.planners", ("track_kernels", "lattice.search_kernels"))

    @UNIT.device
    def inner(x, y): ...

    @UNIT.kernel("f8[,] i8 f8[]")
    def outer(a, k, out): ...      # fills arrays; returns an int or nothing (0)

`outer` is then called with arrays of exactly these forms (see `gcsplan.native.form`), and runs as machine code.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from gcsplan.native.form import read_forms
from gcsplan.native.kernels import Kernels

Function = TypeVar("Function", bound=Callable[..., Any])


class Unit(Kernels):
    """Kernels in some modules of a package that are compiled together.

    ``modules``: all modules that hold a marked function or a constant that one uses, as dotted names within
    ``package``; ``more``: further files, beside the modules, that they depend on. ``vectors``: loops over arrays are
    vectorised before they are shipped, sums in an order that is then fixed; no argument of a function may be a view of
    another's array.
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
        super().__init__(name, folder, (*(f"{m.replace('.', '/')}.py" for m in modules), *more), package, {})
        self.vectors = vectors
        self._modules = tuple(f"{package}.{m}" for m in modules)
        self._plain: dict[int, Callable[..., Any]] = {}
        self._kernels: dict[str, Callable[..., Any]] = {}

    def device(self, function: Function) -> Function:
        """Mark a function that kernels call. Python can call it too, as a plain function."""
        self._plain[id(function)] = function
        return function

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

    def digest(self) -> str | None:
        """See `Kernels.digest`."""
        for module in self._modules:  # so that every kernel is known
            importlib.import_module(module)
        return super().digest()

    def bitcode_from_source(self) -> bytes:
        """See `Kernels.bitcode_from_source`."""
        self.digest()
        source = importlib.import_module("gcsplan.native.source")
        kernels = {name: (function, read_forms(self.forms[name])) for name, function in self._kernels.items()}
        return bytes(source.bitcode_of_plain(kernels, self._plain, vectors=self.vectors))
