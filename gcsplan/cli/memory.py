"""How the process of a command holds memory: it looks for garbage seldom, and keeps what it once took.

A command makes a few hundred thousand objects, nearly all of them while modules are imported, and throws next to
none of them away in cycles: looking for those took a twentieth of the time of a plan, and looking once more at the
very end as much again. The C library gives arrays of more than 128 kB back to the system as soon as they are freed,
and gets every page of the next one anew, as zeros; a planner makes thousands.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import sys
from contextlib import suppress

OBJECTS = 200_000
"""So many new ones, and garbage is looked for among them: about 20 MB (`gc.set_threshold`; Python has 700)."""

ARRAY_BYTES = 32 << 20
"""Larger arrays go back to the system at once."""

KEPT_BYTES = 256 << 20
"""Free memory at the end of the heap beyond this goes back as well."""

# glibc's malloc.h; mallopt(3)
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def settle_memory() -> None:
    """Set it up for this process, once, before anything large is made."""
    gc.set_threshold(OBJECTS, 10, 10)
    atexit.register(gc.freeze)  # what is left then is not looked at again
    if sys.platform == "linux":
        with suppress(OSError, AttributeError, TypeError):  # a C library that has no such call
            mallopt = ctypes.CDLL(None).mallopt
            mallopt(_M_MMAP_THRESHOLD, ARRAY_BYTES)
            mallopt(_M_TRIM_THRESHOLD, KEPT_BYTES)
