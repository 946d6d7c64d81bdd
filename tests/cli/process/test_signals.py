"""A signal ends a command within a second, also while a library computes for many seconds."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.export.test_generation import heed_signals
from tests.support.paths import REPOSITORY

BUSY = """
import os, sys
from pathlib import Path
import numpy as np, shapely
folder = Path(sys.argv[1])
sys.argv = ["gcsplan", "plan", "m.yaml", "--json"]
from gcsplan.cli import main as cli
from gcsplan.export import durable

def command(**_):
    rng = np.random.default_rng(1)
    turn = np.linspace(0.0, 2.0 * np.pi, 60_000, endpoint=False)
    ring = shapely.Polygon((rng.uniform(600.0, 900.0, (60_000, 1)) * np.stack([np.cos(turn), np.sin(turn)], axis=-1)))
    print("begins", file=sys.stderr, flush=True)
    with durable.locked(folder):  # as a batch has its folder
        shapely.is_valid(np.array([ring] * 9))  # half a minute
    print("ended", file=sys.stderr, flush=True)

cli.command_of = lambda called: command
cli.main()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 143), ("SIGINT", 130), ("SIGHUP", 129)])
def test_a_signal_ends_a_command_in_the_middle_of_a_library(number: str, code: int, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY, str(tmp_path)], cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, preexec_fn=heed_signals,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        assert process.stderr.readline() == "begins\n"
        time.sleep(0.2)
        begun = time.monotonic()
        process.send_signal(getattr(signal, number))
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert time.monotonic() - begun < 5.0  # half a second, on a machine that is not busy
    assert process.returncode == code
    assert json.loads(out)["error"]["code"] == code
    assert err.startswith("gcsplan: ")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_process_that_runs_many_commands_listens_once() -> None:
    many = """
import os, sys, threading
sys.argv = ["gcsplan", "--version"]
from gcsplan.cli import main as cli
for _ in range(20):
    try:
        cli.main()
    except SystemExit:
        pass
print(threading.active_count())
"""
    ended = subprocess.run([sys.executable, "-c", many], cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert ended.stdout.splitlines()[-1] == "2"


@pytest.mark.slow
def test_what_python_can_undo_is_undone_also_after_code_that_stops_all_threads() -> None:
    """Between the two calls of the list Python has no turn; the second keeps the listener from looking."""
    busy = """
import hashlib, operator, os, signal, sys, threading
from functools import partial
sys.argv = ["gcsplan", "plan", "m.yaml"]
from gcsplan.cli import main as cli
from gcsplan.export import durable

def command(**_):
    threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGTERM)).start()
    try:
        list(map(operator.call, [
            partial(hashlib.pbkdf2_hmac, "sha256", b"", b"", 200_000),
            partial(sum, range(50_000_000)),
        ]))
    finally:
        print("undone", flush=True)

cli.command_of = lambda called: command
cli.main()
"""
    ended = subprocess.run([sys.executable, "-c", busy], cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (143, "undone\n")


def ended_by(words: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What a process of `entry` does; ``words`` are executed first, and may use ``send()``, a signal to itself."""
    begin = """
import os, signal, sys, types
def send(number=signal.SIGINT):
    os.kill(os.getpid(), number)
class Sends:
    def __init__(self, name): self.name = name
    def find_spec(self, name, *_):
        if name == self.name:
            send()
"""
    return subprocess.run(
        [sys.executable, "-c", begin + words, *arguments], cwd=REPOSITORY, capture_output=True, text=True, timeout=60,
        preexec_fn=heed_signals,
    )  # fmt: skip


@pytest.mark.first_quick
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "module", ["gcsplan.cli.process.exit", "gcsplan.cli.command_table", "typer", "gcsplan.cli.commands.dem"]
)
def test_ctrl_c_while_modules_are_imported_is_quiet(module: str) -> None:
    words = f"sys.meta_path.insert(0, Sends({module!r}))\nfrom gcsplan.cli.main import entry\nentry()"
    ended = ended_by(words, "planners")
    assert ended.returncode in (130, -signal.SIGINT)  # 130 for a shell, both
    assert ended.stderr in ("", "gcsplan: interrupted\n")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_the_exit_code_is_the_signal_s_though_python_executes_a_text() -> None:
    """As dataclasses are made while modules are imported: Python would then end as if by Ctrl-C."""
    words = """
from gcsplan.cli import main as cli
cli.command_of = lambda called: lambda **_: exec("send(signal.SIGTERM)\\nfor k in range(10**9): pass")
cli.entry()
"""
    assert ended_by(words, "plan").returncode == 143


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_signal_while_another_end_is_told_shows_no_traceback() -> None:
    words = """
from gcsplan.cli import main as cli
from gcsplan.cli.process import exit as ending
from gcsplan.errors import InputError
def command(**_):
    raise InputError("wrong")
def told(error):
    print("gcsplan:", error, file=sys.stderr)
    send()
    for k in range(10**9): pass
cli.command_of, ending.complain = lambda called: command, told
cli.entry()
"""
    ended = ended_by(words, "plan")
    assert (ended.returncode, ended.stderr) == (130, "gcsplan: wrong\n")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 143), ("SIGINT", 130)])
def test_a_signal_in_a_callback_whose_exceptions_python_drops_is_not_lost(number: str, code: int) -> None:
    """As while modules are imported: it was told of with a traceback, and the command went on."""
    words = f"""
import time, weakref
from gcsplan.cli import main as cli
class Thing: pass
def gone(_):
    send(signal.{number})
    for k in range(1000): pass
def command(**_):
    thing = Thing()
    watched = weakref.ref(thing, gone)
    del thing
    for k in range(200): time.sleep(0.05)
cli.command_of = lambda called: command
cli.entry()
"""
    ended = ended_by(words, "plan")
    assert ended.returncode == code
    assert ended.stderr.startswith("gcsplan: ")
    assert ended.stderr.count("\n") == 1
