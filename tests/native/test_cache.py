"""The cache of machine code: kept where nobody else can write, bounded, and not trusted blindly."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from gcsplan.native import cache
from gcsplan.native.kernel_unit import QUICK_NOTICE, compilation_reported
from tests.support.toy_kernels import kernels, notices, ship, value


@pytest.mark.slow
def test_kept_code_that_is_spoilt_is_compiled_again(room: Path) -> None:
    ship(kernels(room))
    value(kernels(room))
    [kept] = (room / "cache" / "gcsplan").glob("*.code")
    whole = kept.read_bytes()
    kept.write_bytes(whole[:-100])
    value(kernels(room))
    assert kept.read_bytes() == whole


@pytest.mark.nightly
def test_without_a_cache_to_write_to_kernels_are_compiled_each_time(room: Path) -> None:
    (room / "cache").write_text("a file where the folder should be", encoding="utf-8")
    ship(kernels(room))
    assert notices(room) == notices(room) == [QUICK_NOTICE]
    assert (room / "cache").is_file()


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


posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes")


def reading(name: str, monkeypatch: pytest.MonkeyPatch, **variables: str | None) -> bytes | None:
    """What the cache holds under that name, with these variables of the environment (None: not set)."""
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(variable, raising=False)
    for variable, given in variables.items():
        if given is not None:
            monkeypatch.setenv(variable, given)
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


@pytest.mark.nightly
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
    with compilation_reported(said.append):
        value(kernels(room))
    assert len(said) == 1
    if whose == "folder":
        assert (folder.stat().st_uid, folder.stat().st_mode & 0o777) == (65534, 0o700)
        assert kept.read_bytes()[32:] == body  # nothing of theirs is touched
