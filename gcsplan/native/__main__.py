"""`python -m gcsplan.native`: make the intermediate form of all kernels anew, beside their sources."""

from __future__ import annotations

import os

# For any processor, and not yet cut to vectors of some width; must be set before numba is imported.
os.environ.update(
    NUMBA_CPU_NAME="generic",
    NUMBA_CPU_FEATURES="",
    NUMBA_LOOP_VECTORIZE="0",
    NUMBA_SLP_VECTORIZE="0",
    NUMBA_DISABLE_JIT="0",
)

import importlib
import importlib.metadata
import time

from gcsplan.native import shelf

ALL = ("gcsplan.world._compiled:KERNELS", "gcsplan.planners.compiled:UNIT")


def main() -> None:
    """Make each and say how large it is."""
    for dotted in ALL:
        module, _, name = dotted.partition(":")
        kernels = getattr(importlib.import_module(module), name)
        began = time.perf_counter()
        digest = kernels.digest()
        if digest is None:
            raise SystemExit(f"the sources of {dotted} are not at hand")
        made_with = {name: importlib.metadata.version(name) for name in ("numba", "llvmlite")}
        shelf.write_shipped(kernels.shipped, digest, made_with, kernels.bitcode_from_source())
        took = time.perf_counter() - began
        print(f"{kernels.shipped}: {kernels.shipped.stat().st_size:,} bytes, {took:.1f} s")


if __name__ == "__main__":
    main()
