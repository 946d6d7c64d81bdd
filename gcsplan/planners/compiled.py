"""How this room's kernels are compiled: lean, kept on disk, and made anew when any file here changes.

numba notices a change of the file that a kernel stands in, but not of the files that it calls into; each cached kernel
takes `digest` of all of them as the default of its last parameter, which numba keeps as a part of the key.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.cpu import CPUTargetOptions


def digest(*names: str) -> str:
    """Of files in this room, by name."""
    return hashlib.sha256(b"".join((Path(__file__).parent / name).read_bytes() for name in names)).hexdigest()


def _options(**wanted: object) -> dict[str, Any]:
    """Those compiler options that this numba knows; without the others kernels are the same, but slower."""
    return {name: value for name, value in wanted.items() if hasattr(CPUTargetOptions, name)}


_INSIDE = _options(
    nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, no_rewrites=True, _nrt=False
)

device = njit(**_INSIDE)
"""A function that only kernels call; nothing is allocated in it."""

kernel = njit(
    cache=True, **_options(nogil=True, error_model="numpy", no_rewrites=True, no_cfunc_wrapper=True, _nrt=False)
)
"""What Python calls. Nothing is allocated in it: Python hands in the room and comes back with more if it is short."""
