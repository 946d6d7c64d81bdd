"""The end of a command: one document on standard output, one message on standard error, an exit code."""

from __future__ import annotations

import io
import json
import os
import signal
import stat
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, ClassVar, NoReturn

from gcsplan.cli.process.signals import SignalWatch
from gcsplan.errors import GcsplanError, InputError, UsageError
from gcsplan.export.summary import SCHEMA, write_summary


class Interrupted(GcsplanError):
    """Ctrl-C during a conversation with vehicles; the message says what to do about them."""

    exit_code: ClassVar[int] = 130
    default_reason: ClassVar[str] = "interrupted"


class Terminated(Interrupted):
    """SIGTERM: as Ctrl-C, but sent by another process."""

    exit_code: ClassVar[int] = 143
    default_reason: ClassVar[str] = "terminated"


class HungUp(Interrupted):
    """SIGHUP: as Ctrl-C, but because the terminal is gone."""

    exit_code: ClassVar[int] = 129
    default_reason: ClassVar[str] = "terminated"


_ENDINGS: dict[int, type[Interrupted]] = {
    getattr(signal, name): kind for name, kind in (("SIGTERM", Terminated), ("SIGHUP", HungUp)) if hasattr(signal, name)
}
ENDED = {Interrupted.exit_code} | {kind.exit_code for kind in _ENDINGS.values()}
"""Exit codes of a command that was interrupted."""

AGAIN_S = 0.01
"""Seconds after which a signal is sent again whose KeyboardInterrupt was lost."""

_received: list[int] = []
_last: list[int] = []
_watch: list[SignalWatch] = []
_as_json: list[bool] = []

closers: list[Callable[[GcsplanError], None]] = []
"""The last one closes the document that standard output holds a part of, with an error in it."""


def end_in_good_order(*, as_json: bool = False) -> None:
    """Make SIGTERM and SIGHUP end this process as Ctrl-C does: links are closed, unfinished work is undone.

    A process that was started to ignore one of them (nohup) continues to ignore it. While a library computes, the
    process ends at once, with the same message (`signals.SignalWatch`).
    """
    if threading.current_thread() is not threading.main_thread():  # Python sets handlers in the main thread only
        return
    if not _watch:  # one for a process, which may run several commands
        _watch.append(SignalWatch(_end_at_once))
        sys.unraisablehook = sent_again(_last, sys.unraisablehook)
    _as_json[:] = [as_json]
    owner, watch = os.getpid(), _watch[0]

    def stop(number: int, _: object) -> None:
        watch.heard()
        _last[:] = [number]
        if number in _ENDINGS:
            if os.getpid() != owner:  # a forked child dies by the signal's default
                signal.signal(number, signal.SIG_DFL)
                os.kill(os.getpid(), number)
            _received.append(number)
        raise KeyboardInterrupt

    defaults = dict.fromkeys(_ENDINGS, signal.SIG_DFL) | {signal.SIGINT: signal.default_int_handler}
    for number, default in defaults.items():
        if signal.getsignal(number) is default:
            signal.signal(number, stop)


def sent_again(last: Sequence[int], before: Callable[[Any], object]) -> Callable[[Any], None]:
    """A ``sys.unraisablehook`` that sends the signal ``last[0]`` again if Python dropped its KeyboardInterrupt.

    Python drops it in callbacks of weak references and in finalizers, of which imports have many: it prints the
    traceback, and the command would go on. Other dropped exceptions go to ``before``.
    """

    def hook(lost: Any) -> None:
        if not isinstance(lost.exc_value, KeyboardInterrupt) or not last:
            before(lost)
            return
        again = threading.Timer(AGAIN_S, os.kill, (os.getpid(), last[0]))
        again.daemon = True
        again.start()

    return hook


def _end_at_once(number: int) -> NoReturn:
    """End the process from a thread beside one that computes; nothing else of this process runs any more."""
    if number in _ENDINGS:
        _received.append(number)
    error = interrupted()
    with suppress(Exception):
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K\x1b[?25h")  # a progress bar hides the cursor
        complain(error)
        sys.stderr.flush()
        if closers:
            closers[-1](error)
        elif any(_as_json):
            put(json.dumps({"schema": SCHEMA, "error": error.as_dict()}) + "\n")
        sys.stdout.flush()
    os._exit(error.exit_code)


def interrupted(words: str = "") -> Interrupted:
    """The error to end with after a KeyboardInterrupt, by the signal that caused it."""
    kind = _ENDINGS[_received[0]] if _received else Interrupted
    return kind(words or kind.default_reason)


def emit(document: dict[str, Any], error: dict[str, Any] | None = None) -> None:
    """Write the single JSON document of ``--json``, with the error if there is one."""
    put(write_summary(document | ({"error": error} if error else {}), clocks=True))


def put(text: str) -> None:
    """Write to standard output and flush, so that a failure is reported. Raises InputError."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except (OSError, AttributeError) as error:  # a full disk, or a closed standard output, which is None
        with suppress(OSError, AttributeError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        words = getattr(error, "strerror", None) or "it is closed"
        raise InputError(f"cannot be written: {words}", where="standard output") from error


class _Pipe(io.FileIO):
    """A pipe whose reader may go away: the rest is then written nowhere, and the command goes on to its own end."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return len(memoryview(data).cast("B"))


def outlive_readers() -> None:
    """Let ``gcsplan … | head -1`` do what it does without ``head``: same files, same exit code, no complaint."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        try:
            piped = not stat.S_ISREG(os.fstat(stream.fileno()).st_mode) and not stream.isatty()
        except (AttributeError, OSError, ValueError):  # closed, or no file of the system
            continue
        if piped and stream is getattr(sys, f"__{name}__"):
            stream.flush()
            whole = io.BufferedWriter(_Pipe(stream.fileno(), "wb", closefd=False))
            setattr(
                sys, name,
                io.TextIOWrapper(
                    whole, encoding=stream.encoding, errors=stream.errors, line_buffering=stream.line_buffering,
                    write_through=name == "stderr",
                ),
            )  # fmt: skip


@contextmanager
def talking(names: Sequence[str]) -> Iterator[None]:
    """Wrap a conversation with vehicles: after Ctrl-C the message says what state they may be in."""
    try:
        yield
    except KeyboardInterrupt:
        from gcsplan.app.upload.job import broken_off

        raise interrupted(broken_off(names)) from None


def speak_plainly() -> None:
    """Set the encoding of the outputs: UTF-8 for JSON, and no character such as ° or – can end the program."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8" if "--json" in sys.argv else None, errors="backslashreplace")


def explained(error: Exception) -> GcsplanError:
    """The GcsplanError for an exception; of another kind, unless it is one already."""
    if isinstance(error, GcsplanError):
        return error
    describe = getattr(error, "format_message", None)  # click's usage errors, in whichever click typer uses
    if describe is not None:
        context = getattr(error, "ctx", None)
        if type(error).__name__ == "NoArgsIsHelpError":
            return UsageError(f"give a command\n\n{describe()}")
        return UsageError(f"{describe()} (see {context.command_path if context else 'gcsplan'} --help)")
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):  # compiled code turns Ctrl-C into another error
            return interrupted()
        cause = cause.__cause__ or cause.__context__
    if isinstance(error, FileNotFoundError) and _folder_is_gone():
        return InputError("the current folder was removed: change into one that exists")
    return GcsplanError(f"internal error, a bug in gcsplan: {type(error).__name__}: {error} (--debug shows where)")


def _folder_is_gone() -> bool:
    """Whether the folder that relative paths begin at is no longer there; Linux still lists and describes it."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def printable(text: str) -> str:
    """Text that is safe for a terminal: file names and values may hold control characters, which are replaced."""
    return "".join(c if c.isprintable() or c in "\n\u2009" else "\ufffd" for c in text)


def complain(error: GcsplanError) -> None:
    """Print one message on standard error."""
    with suppress(OSError):  # standard error may be closed
        print(f"gcsplan: {printable(str(error))}", file=sys.stderr)


def fail(error: GcsplanError, as_json: bool, debug: bool) -> NoReturn:
    """Print one message on standard error and, with ``as_json``, one JSON document; then exit with the error's code."""
    if debug:
        traceback.print_exc()
    complain(error)
    if as_json:
        with suppress(InputError):
            emit({}, error.as_dict())
    sys.exit(error.exit_code)
