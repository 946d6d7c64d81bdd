"""LLVM for this machine: from bitcode to machine code, and machine code into memory."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import llvmlite.binding as llvm  # type: ignore[import-untyped]

_CALLED = ("hypot", "sqrt", "floor", "ceil", "sin", "cos", "asin", "atan2", "fmod", "memset", "memcpy")
"""External functions that machine code may call; it contains everything else."""

_engines: list[Any] = []  # machine code lives as long as its engine


def llvm_version() -> str:
    """The version of LLVM within llvmlite; bitcode of a newer major version cannot be read."""
    return ".".join(str(part) for part in llvm.llvm_version_info)


class HostMachine:
    """This machine, as numba sees it: the same processor features, the same options."""

    def __init__(self) -> None:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        self._triple = llvm.get_process_triple()
        self._cpu = llvm.get_host_cpu_name()
        try:
            self._features = llvm.get_host_cpu_features().flatten()
        except RuntimeError:  # not known on every platform: there the processor's name is enough
            self._features = ""

    @property
    def marks(self) -> tuple[str, ...]:
        """The marks of the machine and compiler on which machine code depends, besides its source."""
        return str(llvmlite.__version__), self._triple, self._cpu, self._features

    def compile(self, bitcode: bytes) -> bytes | None:
        """Machine code; None if this LLVM cannot read the bitcode.

        The bitcode has been through LLVM's passes; here it is only translated to the machine's own instructions.
        """
        target = self._target()
        try:
            module = llvm.parse_bitcode(bitcode)
            module.triple = self._triple
            module.data_layout = str(target.target_data)
            module.verify()
        except RuntimeError:
            return None
        return bytes(target.emit_object(module))

    def link(self, code: bytes, names: Sequence[str]) -> dict[str, int]:
        """Load machine code into memory; return the addresses of its functions."""
        empty = llvm.parse_assembly("")
        empty.triple = self._triple
        engine = llvm.create_mcjit_compiler(empty, self._target())  # from here on LLVM sees the process' functions
        if not all(llvm.address_of_symbol(name) for name in _CALLED):
            # numba provides what the C library does not export.
            importlib.import_module("numba.core.registry").cpu_target.target_context  # noqa: B018
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _engines.append(engine)
        addresses = {name: int(engine.get_function_address(name)) for name in names}
        if not all(addresses.values()):
            raise RuntimeError("kept machine code lacks a kernel: remove it from the cache")
        return addresses

    def _target(self) -> Any:
        arch = self._triple.split("-")[0]
        x86 = arch.startswith(("x86", "i386", "i686", "amd64"))
        return llvm.Target.from_triple(self._triple).create_target_machine(
            cpu=self._cpu,
            features=self._features,
            opt=3,
            reloc="static" if x86 else "default",
            codemodel="jitdefault",
            jit=True,
        )
