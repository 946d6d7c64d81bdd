"""From numba functions to LLVM's bitcode: the slow half, done by a developer, or if the shipped form is stale."""

# mypy: disable-error-code="no-untyped-call,no-untyped-def,untyped-decorator"
from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Set
from types import FunctionType
from typing import Any, cast

import llvmlite.binding as llvm  # type: ignore[import-untyped]
from numba import njit, types
from numba.core import cgutils
from numba.core.cpu import CPUTargetOptions
from numba.core.errors import TypingError
from numba.core.options import TargetOptions
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from gcsplan.native.signature import DTYPES, ArgumentForm


def options(**requested: object) -> dict[str, Any]:
    """The compiler options that this numba knows; without the others kernels are the same, but slower."""
    return {name: value for name, value in requested.items() if hasattr(CPUTargetOptions, name)}


KERNEL_OPTIONS = options(
    nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, no_rewrites=True, _nrt=False
)
"""Options of kernels and of the functions that they call: division by zero gives inf or NaN; nothing is allocated."""


# Arguments are never two views of one array, and sums may be computed in any order. That order, and what is put into
# one vector, then become part of the intermediate form, the same for everybody.
CPUTargetOptions.noalias = TargetOptions.Mapping("noalias")
VECTORS = options(fastmath={"reassoc", "nsz"}, noalias=True)
"""Further options of kernels that are vectorised before they are shipped."""

_ANY_ORDER = re.compile(
    r"(?m)^(\s+(?:%\S+ = )?(?:tail )?(?:f(?:add|sub|mul|div|rem|neg|cmp|ptrunc|pext)|phi|select|call)) "
    r"(?:(?:reassoc|nsz) )+"
)


def _slot(builder, block, position):
    return builder.load(builder.gep(block, [position]))


@intrinsic
def integer_at(typingctx, block, position):
    """The int64 in a slot."""

    def lower(context, builder, signature, arguments):
        return _slot(builder, *arguments)

    return types.int64(block, position), lower


@intrinsic
def number_at(typingctx, block, position):
    """The float64 in a slot."""

    def lower(context, builder, signature, arguments):
        return builder.bitcast(_slot(builder, *arguments), context.get_value_type(types.float64))

    return types.float64(block, position), lower


@intrinsic
def array_at(typingctx, block, position, like, shape):
    """A C-contiguous array of that shape (a tuple of int64) whose address is in a slot; ``like``: a dtype."""
    array = types.Array(like.dtype, len(shape), "C")

    def lower(context, builder, signature, arguments):
        block, position, _, lengths = arguments
        out = make_array(array)(context, builder)
        itemsize = context.get_abi_sizeof(context.get_data_type(array.dtype))
        step = context.get_constant(types.intp, itemsize)
        sizes = cgutils.unpack_tuple(builder, lengths)
        strides: list[Any] = []
        for size in reversed(sizes):
            strides.insert(0, step)
            step = builder.mul(step, size)
        populate_array(
            out,
            data=builder.inttoptr(_slot(builder, block, position), out.data.type),
            shape=sizes,
            strides=strides,
            itemsize=context.get_constant(types.intp, itemsize),
            meminfo=None,
        )
        return out._getvalue()

    return array(block, position, like, shape), lower


@intrinsic
def result_of(typingctx, value):
    """A kernel's return value as an int64; 0 if it returns nothing."""
    if not isinstance(value, types.Integer | types.Boolean | types.NoneType):
        raise TypingError(f"a kernel gives back an int or nothing, not {value}")

    def lower(context, builder, signature, arguments):
        if isinstance(value, types.NoneType):
            return context.get_constant(types.int64, 0)
        return context.cast(builder, arguments[0], signature.args[0], types.int64)

    return types.int64(value), lower


def bitcode(kernels: Mapping[str, tuple[Any, tuple[ArgumentForm, ...]]], *, vectors: bool = False) -> bytes:
    """One module with a function of each name; the functions take addresses and lengths for arrays.

    ``vectors``: the kernels were made with `VECTORS`; from here on the order of every sum is fixed.
    """
    whole = None
    for name, (function, forms) in kernels.items():
        text = _compiled(name, function, forms)
        if vectors:
            text = _ANY_ORDER.sub(r"\1 ", text)
        module = llvm.parse_assembly(text)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    assert whole is not None
    for function in whole.functions:
        if not function.is_declaration and function.name not in kernels:
            function.linkage = "internal"
    whole.verify()
    return bytes(whole.as_bitcode())


def with_numba(
    kernels: Mapping[str, Callable[..., Any]],
    others: Mapping[int, Callable[..., Any]],
    inlined: Set[int],
    *,
    vectors: bool = False,
) -> dict[str, Any]:
    """The numba functions of plain ``kernels`` by name.

    ``others``: the plain functions, kernels included, that kernels call; each by the id of the object that modules know
    under its name. ``inlined``: ids of the functions that are copied into their caller.
    """
    scopes: dict[int, dict[str, Any]] = {}

    def compiled(function: Callable[..., Any]) -> Any:
        """Its numba function, in a copy of its module in which all these functions are numba's."""
        plain = cast(FunctionType, function)
        scope = scopes.setdefault(id(plain.__globals__), dict(plain.__globals__))
        twin = FunctionType(plain.__code__, scope, plain.__name__, plain.__defaults__, plain.__closure__)
        copied: dict[str, Any] = {"inline": "always"} if id(function) in inlined else {}
        return njit(**copied, **KERNEL_OPTIONS, **(VECTORS if vectors else {}))(twin)

    twins = {id(function): compiled(function) for function in {id(f): f for f in others.values()}.values()}
    for scope in scopes.values():
        for name, value in scope.items():
            if id(value) in others:
                scope[name] = twins[id(others[id(value)])]
    return {name: twins[id(function)] for name, function in kernels.items()}


def _compiled(name: str, function: Any, forms: tuple[ArgumentForm, ...]) -> str:
    """LLVM's intermediate form of a kernel and all that it calls, as text; the kernel has the name ``name``."""
    arguments = []
    at = 0
    for form in forms:
        if form.dimensions:
            lengths = "".join(f"integer_at(block, {at + 1 + d}), " for d in range(form.dimensions))
            arguments.append(f"array_at(block, {at}, {form.letters}, ({lengths}))")
        elif form.letters == "f8":
            arguments.append(f"number_at(block, {at})")
        else:
            arguments.append(f"integer_at(block, {at})" + (" != 0" if form.letters == "b1" else ""))
        at += len(form.slots)
    scope: dict[str, Any] = {
        "array_at": array_at,
        "number_at": number_at,
        "integer_at": integer_at,
        "kernel": function,
        "result_of": result_of,
        **{letters: dtype.type for letters, dtype in DTYPES.items()},
    }
    exec(f"def entry(block):\n    return result_of(kernel({', '.join(arguments)}))\n", scope)
    entry = njit(**KERNEL_OPTIONS)(scope["entry"])
    entry.compile(types.int64(types.CPointer(types.int64)))
    [compiled] = entry.overloads.values()
    module = llvm.parse_assembly(compiled.library.get_llvm_str())
    module.get_function(compiled.fndesc.llvm_func_name).name = name
    return str(module)
