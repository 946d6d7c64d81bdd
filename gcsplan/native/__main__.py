"""`python -m gcsplan.native [NAME ...]`: make the intermediate form of kernels anew, beside their sources."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import platform
import subprocess
import sys
import time

from gcsplan.native import shelf
from gcsplan.native.kernels import Kernels
from gcsplan.native.machine import llvm_version

ALL = {
    "world": "gcsplan.world._compiled:KERNELS",
    "planners": "gcsplan.planners.compiled:UNIT",
    "swarm": "gcsplan.planners.swarm.compiled:UNIT",
    "turns": "gcsplan.planners.turns.compiled:UNIT",
}
"""Kernel units by name. Each is made in its own process, because numba reads its options once."""

OPTIONS = {
    # For any processor, not vectorised.
    False: {"CPU_NAME": "generic", "CPU_FEATURES": "", "LOOP_VECTORIZE": "0", "SLP_VECTORIZE": "0"},
    # Vectorised for vectors of four numbers; processors without such vectors compute two at a time.
    True: {"CPU_NAME": "haswell", "CPU_FEATURES": "", "LOOP_VECTORIZE": "1", "SLP_VECTORIZE": "1"},
}


def main(names: list[str]) -> None:
    """Make each unit and print its size."""
    if not set(names) <= set(ALL):
        raise SystemExit(f"usage: python -m gcsplan.native [{' | '.join(ALL)}] …: without a name, all of them")
    if len(names) != 1:
        for name in names or ALL:
            subprocess.run([sys.executable, "-m", "gcsplan.native", name], check=True)
        return
    dotted = ALL[names[0]]
    module, _, name = dotted.partition(":")
    kernels: Kernels = getattr(importlib.import_module(module), name)
    began = time.perf_counter()
    digest = kernels.digest()
    if digest is None:
        raise SystemExit(f"the sources of {dotted} are not at hand")
    vectors = getattr(kernels, "vectors", False)
    if vectors and platform.machine().lower() not in ("x86_64", "amd64"):
        raise SystemExit(f"{names[0]} is made on x86-64 alone: what is best in one vector is asked of that processor")
    assert "numba" not in sys.modules
    os.environ.update({f"NUMBA_{key}": value for key, value in OPTIONS[vectors].items()}, NUMBA_DISABLE_JIT="0")
    made_with = {name: importlib.metadata.version(name) for name in ("numba", "llvmlite")} | {"llvm": llvm_version()}
    shelf.write_shipped(kernels.shipped, digest, made_with, kernels.bitcode_from_source())
    took = time.perf_counter() - began
    print(f"{kernels.shipped}: {kernels.shipped.stat().st_size:,} bytes, {took:.1f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
