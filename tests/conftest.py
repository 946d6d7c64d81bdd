"""Settings of the whole suite: reproducible random examples without a time limit, and plans without a clock.

Hypothesis draws the same examples in every run, so a failure repeats. Plans end by counted work alone, so a path is
the same on a busy machine. A test of the clock itself hands a clock to its budget.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings

from tests.support import effort

RESEARCH = Path(__file__).parent / "research"
"""Its slow tests are nightly."""


def pytest_configure(config: pytest.Config) -> None:
    gc.set_threshold(20_000)  # syntax trees of whole packages live on: to walk them often doubles the time they take
    gc.disable()  # until all tests are collected: what rewriting and collecting make lives on, or has no circles
    os.environ.pop("GCSPLAN_UNITS", None)  # the suite reads the words of the default
    os.environ["GCSPLAN_CLOCK"] = "off"
    effort.full = config.getoption("markexpr") != effort.QUICK
    settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=effort.draws(100))
    settings.load_profile("fixed")
    if sys.dont_write_bytecode and not hasattr(config, "workerinput"):
        keep_byte_code(config.rootpath / ".pytest_cache" / "byte_code")


def keep_byte_code(folder: Path) -> None:
    """Let workers and commands keep byte code in this folder, where ``PYTHONDONTWRITEBYTECODE`` bars it beside sources.

    Without byte code each worker rewrites all test files, which takes three times as long as to read them, and each
    command compiles the whole package that it imports. Python then looks nowhere else: the byte code that installed
    packages have is linked into a new folder, since each worker would compile them anew, for ten seconds.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder)
    if folder.exists():
        return
    for top in {sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")}:
        for here, inner, _ in os.walk(top):
            inner[:] = [name for name in inner if name not in ("site-packages", "__pycache__")]
            made = folder / Path(here).relative_to(Path(here).anchor)
            made.mkdir(parents=True, exist_ok=True)
            for file in Path(here, "__pycache__").glob(f"*.{sys.implementation.cache_tag}.pyc"):
                with contextlib.suppress(OSError):  # on another disk: it is compiled once more
                    os.link(file, made / file.name)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let each worker import the test files from a different place on, so that pytest rewrites each file only once.

    Workers collect all tests in the same order. Without this, all of them would rewrite the same file at the same time,
    which costs more than all imports. A worker finds the files that others have rewritten in the byte code cache.
    """
    whole = session.config.args_source is pytest.Config.ArgsSource.TESTPATHS
    worker, workers = (os.environ.get(f"PYTEST_XDIST_WORKER{name}") for name in ("", "_COUNT"))
    if sys.dont_write_bytecode or not whole or worker is None or workers is None:
        return
    top = session.config.rootpath
    files = sorted(path for folder in ("tests", "sitl_tests") for path in Path(top, folder).rglob("test_*.py"))
    first = len(files) * int(worker.removeprefix("gw")) // int(workers)
    for path in (*files[first:], *files[:first]):
        with contextlib.suppress(Exception, pytest.skip.Exception):  # collection reports the error later
            importlib.import_module(".".join(path.relative_to(top).with_suffix("").parts))


def pytest_collection_finish() -> None:
    """Leave what was collected out of the garbage collector's walks: thousands of tests that live until the end."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Mark tests as slow: with the mark ``first_quick`` all parameters but the first; in a full run all random tests.
    Mark as nightly, with ``nightly_but``, all parameters but those that it names.

    The quick suite runs those random tests too, with a part of their draws.
    """
    seen: set[str] = set()
    for item in items:
        test = item.nodeid.partition("[")[0]
        if item.get_closest_marker("first_quick") and not item.get_closest_marker("slow"):
            if test in seen:
                item.add_marker("slow")
            seen.add(test)
    for item in items:
        kept = item.get_closest_marker("nightly_but")
        if kept and item.name.partition("[")[2].removesuffix("]") not in kept.args:
            item.add_marker("nightly")
    for item in items if effort.full else ():
        if item.get_closest_marker("draws") or is_hypothesis_test(getattr(item, "obj", None)):
            item.add_marker("slow")
    for item in items:
        if RESEARCH in item.path.parents and item.get_closest_marker("slow"):
            item.add_marker("nightly")  # it is apart, and a change seldom breaks it
