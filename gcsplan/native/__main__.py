"""`python -m gcsplan.native [NAME ...]`: make the intermediate form of kernels anew, beside their sources."""

from __future__ import annotations

import importlib.metadata
import os
import pkgutil
import platform
import subprocess
import sys
import time

from gcsplan.native import cache
from gcsplan.native.kernel_unit import KernelUnit
from gcsplan.native.llvm import llvm_version

KERNEL_UNITS = {
    "world": "gcsplan.world.kernels.compiled:WORLD_UNIT",
    "planners": "gcsplan.planners.compiled:PLANNERS_UNIT",
    "swarm": "gcsplan.research.swarm.compiled:SWARM_UNIT",
    "turns": "gcsplan.planners.turns.compiled:TURNS_UNIT",
}
"""Where kernel units stand, by name. Each is made in its own process, because numba reads its options once."""

NUMBA_OPTIONS = {
    # For any processor, not vectorised.
    False: {"CPU_NAME": "generic", "CPU_FEATURES": "", "LOOP_VECTORIZE": "0", "SLP_VECTORIZE": "0"},
    # Vectorised for vectors of four numbers; processors without such vectors compute two at a time.
    True: {"CPU_NAME": "haswell", "CPU_FEATURES": "", "LOOP_VECTORIZE": "1", "SLP_VECTORIZE": "1"},
}


def kernel_unit(name: str) -> KernelUnit:
    """The unit of this name."""
    unit: KernelUnit = pkgutil.resolve_name(KERNEL_UNITS[name])
    return unit


def main(names: list[str]) -> None:
    """Make each unit and print its size."""
    if not set(names) <= set(KERNEL_UNITS):
        raise SystemExit(f"usage: python -m gcsplan.native [{' | '.join(KERNEL_UNITS)}] …: without a name, all of them")
    if len(names) != 1:
        for name in names or KERNEL_UNITS:
            subprocess.run([sys.executable, "-m", "gcsplan.native", name], check=True)
        return
    unit = kernel_unit(names[0])
    began = time.perf_counter()
    digest = unit.digest()
    if digest is None:
        raise SystemExit(f"the sources of the kernels {names[0]} are not at hand")
    if unit.vectors and platform.machine().lower() not in ("x86_64", "amd64"):
        raise SystemExit(f"{names[0]} is made on x86-64 alone: the width of its vectors is chosen for that processor")
    assert "numba" not in sys.modules
    os.environ.update(
        {f"NUMBA_{key}": value for key, value in NUMBA_OPTIONS[unit.vectors].items()}, NUMBA_DISABLE_JIT="0"
    )
    made_with = {name: importlib.metadata.version(name) for name in ("numba", "llvmlite")} | {"llvm": llvm_version()}
    cache.write_shipped(unit.shipped, digest, made_with, unit.bitcode_from_source())
    took = time.perf_counter() - began
    print(f"{unit.shipped}: {unit.shipped.stat().st_size:,} bytes, {took:.1f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
