"""The command line: parse, one call, print, exit code.

The commands are imported only once signals are heard: their imports take a tenth of a second and more.
"""

from __future__ import annotations

import signal
import threading

_hears = threading.current_thread() is threading.main_thread()
_before = signal.getsignal(signal.SIGINT)
if _hears and _before is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while modules are imported ends without a traceback

import os  # noqa: E402
import sys  # noqa: E402
from contextlib import suppress  # noqa: E402
from typing import Any, NoReturn  # noqa: E402

from gcsplan.cli.process.exit import (  # noqa: E402
    ENDED,
    Interrupted,
    end_in_good_order,
    explained,
    fail,
    interrupted,
    outlive_readers,
    put,
    speak_plainly,
)
from gcsplan.cli.process.memory import settle_memory  # noqa: E402
from gcsplan.cli.process.signals import ENDING  # noqa: E402
from gcsplan.errors import GcsplanError, InputError  # noqa: E402

if _hears:
    signal.signal(signal.SIGINT, _before)


NO_MEMORY = "not enough memory for this: give a smaller area, coarser terrain, fewer zones or items"
NO_THREAD = "can't start new thread"
"""The words of Python's RuntimeError where there is no memory for the stack of a thread."""


def command_of(called: str) -> Any:
    """The command ``called``; its imports, the most of the time until it begins, are made here."""
    from gcsplan.cli.command_table import commands

    return commands(called)


def main() -> NoReturn:
    """Run a command and exit with its code; an error prints one message without traceback (``--debug`` shows it)."""
    debug = "--debug" in sys.argv
    arguments = [a for a in sys.argv[1:] if a != "--debug"]
    as_json = "--json" in arguments
    try:
        end_in_good_order(as_json=as_json)
        outlive_readers()
        speak_plainly()
        settle_memory()
        # gcsplan uses no plug-ins of pydantic; a search for them reads the lists of all installed packages
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
        # With standalone_mode=False click returns the code of typer.Exit instead of exiting.
        code = command_of(arguments[0] if arguments else "")(args=arguments, prog_name="gcsplan", standalone_mode=False)
        if code == Interrupted.exit_code:  # typer's code for Ctrl-C
            raise KeyboardInterrupt
        put("")
        sys.exit(code if isinstance(code, int) else 0)
    except GcsplanError as error:
        fail(error, as_json, debug)
    except KeyboardInterrupt:
        fail(interrupted(), as_json, debug)
    except MemoryError:
        fail(InputError(NO_MEMORY, reason="memory"), as_json, debug)
    except Exception as error:  # the only place where a bug of gcsplan becomes an exit code
        if str(error) == NO_THREAD:
            fail(InputError(NO_MEMORY, reason="memory"), as_json, debug)
        fail(interrupted() if type(error).__name__ == "Abort" else explained(error), as_json, debug)


def entry() -> NoReturn:
    """`main` as the only work of a process: a signal at any moment ends it, without a traceback."""
    code: Any = Interrupted.exit_code
    try:
        main()
    except SystemExit as ended:
        code = ended.code
    except KeyboardInterrupt:  # it came before the command began, or while another end was reported
        code = interrupted().exit_code
    if code in ENDED:
        _end_now(code)
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    sys.exit(code)


def _end_now(code: int) -> NoReturn:
    """End a process that was interrupted, and has undone what it began.

    What libraries do at exit is left out: it may wait for seconds for workers that compute, and Python ends as if by
    Ctrl-C, whatever the exit code, if a KeyboardInterrupt passed through a text that it executed (as it does to make
    dataclasses; run_eval_code_obj).
    """
    executor = sys.modules.get("gcsplan.app.parallel.executor")
    if executor is not None:
        executor.end_processes()
    with suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    entry()
