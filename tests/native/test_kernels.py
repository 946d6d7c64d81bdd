"""Compiled kernels: called with the right arguments or not at all, found again, and never older than their source."""

from __future__ import annotations

import copy
import hashlib
import importlib
import itertools
import json
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.native import cache
from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_told
from gcsplan.native.llvm import HostMachine
from gcsplan.native.signature import Held, read_forms
from gcsplan.world._compiled import UNIT as WORLD

SOURCE = """
from pathlib import Path

from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_told

UNIT = KernelUnit("toy", Path(__file__).parent, "toys", ("weighing",))
FACTOR = {factor}


@UNIT.inlined
def times(value, factor):
    return value * factor


@UNIT.kernel("f8[,] f4[] i8[,,] b1[] f8 i8 b1 f8[]")
def weigh(a, b, c, d, x, k, whole, out):
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * (i + 1)
    for i in range(len(b)):
        total += b[i] / x
    if whole:
        for i in range(len(d)):
            if d[i]:
                total += c[i, 0, 1] * k
    out[0] = times(total, FACTOR)
    return c.shape[2] + k
"""


def expected(given: list[Any], factor: float = 1.0) -> float:
    a, b, c, d, x, k, whole, _ = given
    total = sum(a[i, j] * (i + 1) for i, j in itertools.product(*map(range, a.shape))) + sum(float(v) / x for v in b)
    return float((total + (sum(c[i, 0, 1] * k for i in range(len(d)) if d[i]) if whole else 0.0)) * factor)


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the source of a kernel, and a cache of its own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "toys").mkdir()
    write(tmp_path, 1.0)
    yield tmp_path
    forget("toys")


def write(room: Path, factor: float) -> None:
    (room / "toys" / "weighing.py").write_text(SOURCE.format(factor=factor), encoding="utf-8")


def forget(package: str) -> None:
    for name in [m for m in sys.modules if m.split(".")[0] == package]:
        del sys.modules[name]
    importlib.invalidate_caches()


def imported_anew(name: str) -> Any:
    """A module, from its source as it stands."""
    forget(name.split(".")[0])
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    try:
        return importlib.import_module(name)
    finally:
        sys.dont_write_bytecode = before


def kernels(room: Path) -> KernelUnit:
    unit = imported_anew("toys.weighing").UNIT
    assert isinstance(unit, KernelUnit)
    assert unit.folder == room / "toys"
    return unit


MADE: dict[str, bytes] = {}
"""Bitcode by the source that it was made from, which takes longer than all else here."""


def ship(of: KernelUnit) -> None:
    digest = of.digest()
    assert digest is not None
    source = (of.shipped.parent / "weighing.py").read_text(encoding="utf-8")
    bitcode = MADE[source] = MADE.get(source) or of.bitcode_from_source()
    cache.write_shipped(of.shipped, digest, {}, bitcode)


def arguments() -> list[Any]:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 4)), rng.normal(size=5).astype(np.float32), rng.integers(-9, 9, (3, 2, 2))
    a.setflags(write=False)
    return [a, b, c, np.array([True, False, True]), 0.25, 7, True, np.zeros(1)]


def value(of: KernelUnit, factor: float = 1.0) -> float:
    given = arguments()
    assert of["weigh"](*given) == 2 + 7
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == pytest.approx(expected(given, factor), rel=1e-12)
    return float(out[0])


def test_what_is_shipped_was_made_from_the_source_as_it_stands() -> None:
    made_of = json.loads(WORLD.shipped.read_bytes().partition(b"\n")[0])["sources"]
    assert made_of == WORLD.digest(), "run python -m gcsplan.native"


def test_this_llvm_reads_what_is_shipped() -> None:
    bitcode = cache.read_shipped(WORLD.shipped, WORLD.digest())
    assert bitcode is not None
    code = HostMachine().compile(bitcode)
    assert code is not None
    assert set(HostMachine().link(code, tuple(WORLD.forms))) == {"judge", "pieces", "around", "local_extrema"}


def test_a_kernel_from_source_from_what_is_shipped_and_from_the_cache_is_the_same(room: Path) -> None:
    said: list[str] = []
    with compilation_told(said.append):
        from_source = value(kernels(room))
        assert [words.startswith(SLOW_NOTICE) for words in said] == [True]
        ship(kernels(room))
        from_shipped = value(kernels(room))
        assert [words.startswith(QUICK_NOTICE) for words in said[1:]] == [True]
        assert value(kernels(room)) == from_shipped == from_source
        assert len(said) == 2  # the third was found in the cache


def test_a_change_of_the_source_is_never_answered_with_older_code(room: Path) -> None:
    ship(kernels(room))
    value(kernels(room))
    write(room, 3.0)
    value(kernels(room), 3.0)


@pytest.mark.parametrize(
    "spoilt",
    [pytest.param(b"", marks=pytest.mark.slow), b"{}\n", pytest.param(b"not json\nx", marks=pytest.mark.slow), None],
)
def test_what_is_shipped_may_be_missing_or_spoilt(room: Path, spoilt: bytes | None) -> None:
    of = kernels(room)
    if spoilt is not None:
        of.shipped.write_bytes(spoilt)
    value(of)


def test_bitcode_that_this_llvm_cannot_read_is_made_anew_from_source(room: Path) -> None:
    of = kernels(room)
    digest = of.digest()
    assert digest is not None
    cache.write_shipped(of.shipped, digest, {}, b"BC\xc0\xde from the future")
    value(of)


def test_kept_code_that_is_spoilt_is_compiled_again(room: Path) -> None:
    ship(kernels(room))
    value(kernels(room))
    [kept] = (room / "cache" / "gcsplan").glob("*.code")
    whole = kept.read_bytes()
    kept.write_bytes(whole[:-100])
    value(kernels(room))
    assert kept.read_bytes() == whole


def test_without_a_cache_to_write_to_kernels_are_compiled_each_time(room: Path) -> None:
    (room / "cache").write_text("a file where the folder should be", encoding="utf-8")
    ship(kernels(room))
    value(kernels(room))
    value(kernels(room))


def test_old_code_does_not_pile_up(room: Path) -> None:
    folder = room / "cache" / "gcsplan"
    for k in range(cache.NEWEST + 5):
        cache.keep(f"toy-{k}.code", bytes([k]))
        os.utime(folder / f"toy-{k}.code", (k, k))
    (folder / "toy-1.codeabc.part").write_bytes(b"cut off")
    (folder / "toy-2.codeabc.part").write_bytes(b"being written")
    os.utime(folder / "toy-1.codeabc.part", (1, 1))
    assert cache.keep("toy-last.code", b"new")
    assert len(list(folder.glob("*.code"))) == cache.NEWEST
    assert [p.name for p in folder.glob("*.part")] == ["toy-2.codeabc.part"]
    assert cache.read_kept("toy-last.code") == b"new"


# -- who may have put it there ----------------------------------------------------------------------------------------

posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes")


def reading(name: str, monkeypatch: pytest.MonkeyPatch, **variables: str | None) -> bytes | None:
    """What the cache holds under that name, with these variables of the environment (None: not set)."""
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(variable, raising=False)
    for variable, value in variables.items():
        if value is not None:
            monkeypatch.setenv(variable, value)
    return cache.read_kept(name)


@posix
def test_code_is_kept_in_the_users_own_cache_and_nowhere_relative(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    for folder in (home, elsewhere):
        folder.mkdir()
    monkeypatch.chdir(elsewhere)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    for wanted, variables in (
        (home / ".cache", {"HOME": str(home), "XDG_CACHE_HOME": None}),
        (home / ".cache", {"HOME": str(home), "XDG_CACHE_HOME": "relative"}),
        (home / "xdg", {"HOME": str(home), "XDG_CACHE_HOME": str(home / "xdg")}),
        (home / "numba", {"HOME": str(home), "XDG_CACHE_HOME": None, "NUMBA_CACHE_DIR": str(home / "numba")}),
        (None, {"HOME": "relative"}),
        (None, {"HOME": str(home), "NUMBA_CACHE_DIR": "relative"}),
    ):
        assert reading("toy-1.code", monkeypatch, **variables) is None
        assert cache.keep("toy-1.code", b"code") is (wanted is not None)
        assert cache.read_kept("toy-1.code") == (None if wanted is None else b"code")
        if wanted is not None:
            kept = wanted / "gcsplan" / "toy-1.code"
            assert kept.parent.stat().st_mode & 0o777 == 0o700
            assert kept.stat().st_mode & 0o777 == 0o600
            kept.unlink()
    assert list(elsewhere.iterdir()) == []


def test_without_any_home_kernels_are_compiled_in_memory(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(*_: object) -> Path:
        raise RuntimeError("Could not determine home directory.")

    ship(kernels(room))
    monkeypatch.setattr(Path, "home", homeless)
    assert reading("toy-1.code", monkeypatch) is None
    assert not cache.keep("toy-1.code", b"code")
    value(kernels(room))


@posix
@pytest.mark.parametrize(("mode", "kept"), [(0o755, True), (0o750, True), (0o770, False), (0o777, False)])
def test_a_wider_folder_of_ours_is_tightened_and_emptied_if_others_could_write(
    room: Path, mode: int, kept: bool
) -> None:
    folder = room / "cache" / "gcsplan"
    assert cache.keep("toy-1.code", b"code")
    folder.chmod(mode)
    assert cache.read_kept("toy-1.code") == (b"code" if kept else None)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert cache.keep("toy-2.code", b"more")
    assert cache.read_kept("toy-2.code") == b"more"


@posix
@pytest.mark.parametrize("trick", ["writable", "linked", "link", "pipe", "folder", "large"])
def test_a_file_that_others_may_have_written_is_not_run(
    room: Path, monkeypatch: pytest.MonkeyPatch, trick: str
) -> None:
    kept = room / "cache" / "gcsplan" / "toy-1.code"
    assert cache.keep("toy-1.code", b"code")
    if trick == "writable":
        kept.chmod(0o620)
    elif trick == "linked":
        os.link(kept, room / "another name")
    elif trick == "large":
        monkeypatch.setattr(cache, "MAX_CODE_BYTES", 20)
    else:
        kept.rename(room / "moved")
        if trick == "link":
            kept.symlink_to(room / "moved")
        elif trick == "pipe":
            os.mkfifo(kept)
        else:
            kept.mkdir()
    assert cache.read_kept("toy-1.code") is None


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can be somebody else")
@pytest.mark.parametrize("whose", ["folder", "file"])
def test_somebody_elses_code_is_not_run_whatever_its_digest_says(room: Path, whose: str) -> None:
    ship(kernels(room))
    value(kernels(room))
    folder = room / "cache" / "gcsplan"
    [kept] = folder.glob("*.code")
    body = b"machine code of somebody else's"
    kept.write_bytes(hashlib.sha256(body).digest() + body)  # LLVM would take it for an object file, and end badly
    os.chown(folder if whose == "folder" else kept, 65534, 65534)
    said: list[str] = []
    with compilation_told(said.append):
        value(kernels(room))
    assert len(said) == 1
    if whose == "folder":
        assert (folder.stat().st_uid, folder.stat().st_mode & 0o777) == (65534, 0o700)
        assert kept.read_bytes()[32:] == body  # nothing of theirs is touched


def test_threads_that_come_at_once_get_the_same_code(room: Path) -> None:
    ship(kernels(room))
    of, found = kernels(room), []
    gate = threading.Barrier(4)

    def work() -> None:
        gate.wait(10.0)
        found.append(value(of))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30.0)
    assert len(found) == 4
    assert len(set(found)) == 1


def test_only_arguments_of_the_right_form_reach_machine_code(room: Path) -> None:
    ship(kernels(room))
    weigh = kernels(room)["weigh"]
    good = arguments()
    bad: list[tuple[int, object]] = [
        (0, np.zeros((3, 4), np.float32)),
        (0, np.zeros(4)),
        (0, np.zeros((4, 3)).T),
        (1, np.zeros(5)),
        (2, np.zeros((3, 2, 2), np.int32)),
        (3, np.zeros(3, np.int8)),
        (7, np.zeros(2)[::-1]),
    ]
    for place, wrong in bad:
        with pytest.raises(TypeError):
            weigh(*[wrong if k == place else a for k, a in enumerate(good)])
    for count in (7, 9):
        with pytest.raises(TypeError, match="takes 8 arguments"):
            weigh(*(good + good)[:count])


def test_held_arguments_stand_in_for_their_own_form_alone(room: Path) -> None:
    ship(kernels(room))
    of = kernels(room)
    weigh, given = of["weigh"], arguments()
    held = Held("f4[] i8[,,] b1[]", *given[1:4])
    weigh(given[0], held, *given[4:])
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == value(of)
    with pytest.raises(TypeError, match=r"from its 1\. on"):
        weigh(held, *given[3:])
    with pytest.raises(TypeError, match=r"from its 8\. on"):
        weigh(*given[:7], held)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda held: pickle.loads(pickle.dumps(held))])
def test_a_copy_of_held_arguments_has_addresses_of_its_own(room: Path, copied: Callable[[Held], Held]) -> None:
    ship(kernels(room))
    of, given = kernels(room), arguments()
    twin = copied(Held("f8[,] f4[] i8[,,] b1[]", *given[:4]))
    of["weigh"](twin, *given[4:])
    assert given[-1][0] == value(of)
    assert [twin.slots[k] for k in (0, 3, 5, 9)] == [a.ctypes.data for a in twin.arguments]
    assert twin.slots[0] != given[0].ctypes.data


def test_empty_arrays_are_arguments_too(room: Path) -> None:
    ship(kernels(room))
    given = arguments()
    given[0], given[1] = np.zeros((0, 4)), np.zeros(0, np.float32)
    kernels(room)["weigh"](*given)
    out = given[-1]
    assert isinstance(out, np.ndarray)
    assert out[0] == pytest.approx(expected(given))


MARKED = """
import math
from pathlib import Path

from {package}.{helper} import SCALE, longest
from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_told

from {package}._unit import UNIT


@UNIT.device
def shorter(x, y):
    return min(longest(x, y), x * y) / SCALE


@UNIT.kernel("f8[] i4[] i1[] f8[]")
def fold(a, b, c, out):
    for i in range(len(a)):
        out[i] = shorter(a[i], b[i] + c[i])
"""
HELPER = """
from {package}._unit import UNIT

SCALE = {scale}


@UNIT.device
def longest(x, y):
    return math.sqrt(x * x + y * y) if x > 0.0 else SCALE * y


import math
"""
UNIT_OF = """
from pathlib import Path

from gcsplan.native.kernel_unit import QUICK_NOTICE, SLOW_NOTICE, KernelUnit, compilation_told

UNIT = KernelUnit("marked", Path(__file__).parent, "{package}", ("_unit", "inner.helper", "marked"))
"""


def fold_of(room: Path, package: str, scale: float) -> Any:
    """The functions of a package with marked kernels, written anew."""
    folder = room / package
    (folder / "inner").mkdir(parents=True, exist_ok=True)
    files = {"__init__": "", "_unit": UNIT_OF, "inner/__init__": "", "inner/helper": HELPER, "marked": MARKED}
    for name, text in files.items():
        text = text.format(package=package, helper="inner.helper", scale=scale)
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return imported_anew(f"{package}.marked")


def test_marked_functions_run_as_machine_code_and_are_plain_functions_still(room: Path) -> None:
    a, b, c = np.array([1.5, -2.0, 3.0]), np.array([4, 5, -6], np.int32), np.array([1, 2, 3], np.int8)
    for scale in (2.0, 0.5):  # the second time a constant in a module that the kernel's own imports has changed
        marked = fold_of(room, "marked_room", scale)
        quick, plain = np.zeros(3), np.zeros(3)
        assert marked.fold(a, b, c, quick) == 0
        marked.fold.__wrapped__(a, b, c, plain)
        assert quick.tolist() == plain.tolist()
        assert marked.shorter(3.0, 4.0) == 5.0 / scale
        with pytest.raises(TypeError):
            marked.fold(a, b.astype(np.int64), c, quick)


def test_two_kernels_of_one_name_are_refused(room: Path) -> None:
    marked = fold_of(room, "marked_twice", 1.0)
    with pytest.raises(ValueError, match="are called fold"):
        marked.UNIT.kernel("f8")(marked.fold.__wrapped__)


@pytest.mark.parametrize("words", ["f2", "f8[", "f8[,,,]", "f4", "[]", "x8[,]"])
def test_other_forms_are_refused(words: str) -> None:
    with pytest.raises(ValueError, match="a form is"):
        read_forms(words)
