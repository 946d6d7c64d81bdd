"""Memory settings of a command's process: rare garbage collection, and freed memory is kept for reuse.

A command makes a few hundred thousand objects, nearly all of them while modules are imported, and almost none become
garbage cycles. Searching for those took a twentieth of the time of a plan, and the search at exit as much again. By
default the C library returns arrays of more than 128 kB to the system as soon as they are freed, and gets every page of
the next one anew, zeroed; a planner makes thousands of them.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import sys
from contextlib import suppress

OBJECTS = 200_000
"""New objects after which garbage is searched for, about 20 MB (`gc.set_threshold`; Python's default is 700)."""

ARRAY_BYTES = 32 << 20
"""Arrays above this size are returned to the system at once."""

KEPT_BYTES = 256 << 20
"""Free memory at the end of the heap above this size is returned too."""

# glibc's malloc.h; mallopt(3)
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def settle_memory() -> None:
    """Apply the settings to this process; call once, before anything large is allocated."""
    gc.set_threshold(OBJECTS, 10, 10)
    atexit.register(gc.freeze)  # skip the search for garbage at exit
    if sys.platform == "linux":
        with suppress(OSError, AttributeError, TypeError):  # the C library may lack this call
            mallopt = ctypes.CDLL(None).mallopt
            mallopt(_M_MMAP_THRESHOLD, ARRAY_BYTES)
            mallopt(_M_TRIM_THRESHOLD, KEPT_BYTES)
