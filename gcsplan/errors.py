"""Every error that gcsplan raises on purpose, and the exit code that it leads to.

    GcsplanError                    70  a bug of gcsplan, if nothing below fits
    ├── InputError     (ValueError)       2  bad input; carries every problem found, each with its place
    │   └── UsageError                    2  wrong options on the command line
    ├── NoMission      (RuntimeError)     3  no mission exists or was found; ``reason`` says which
    ├── CheckFailed    (RuntimeError)     4  a check or a rehearsal found a violation, or could not judge
    ├── VehicleRefused (ConnectionError)  5  the vehicle refused, or gcsplan refused to send
    ├── LinkError      (ConnectionError)  6  the link is dead, or the outcome is unknown
    ├── Cancelled                       130  the caller cancelled the work
    └── ReadBackDiffers (RuntimeError)    7  the list on board differs from the list that was sent

A message states what was required, what was given, where, and what to do about it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Literal

MOST_NAMES = 2000
"""Most files of a folder that are looked at for a name."""

WORST = (70, 7, 6, 5, 4, 3, 2, 0)
"""Exit codes from the worst to the best."""

NoMissionReason = Literal["infeasible", "not_found", "time", "separation", "battery", "wind", "too_many_items"]


ProblemCode = Literal["", "unknown_key", "missing", "missing_limit", "swapped"]


@dataclass(frozen=True, slots=True)
class Mistake:
    """One mistake in the input: its place (``file: key.path``) and what to do about it.

    ``code`` is its kind, where programs tell kinds apart, ``meant`` are the names that may have been meant, and
    ``line`` is the end of the message that says the line, if one is known, and ``in_line`` the line's number, from 1;
    ``by`` are other keys whose values make it one.
    """

    where: str
    message: str
    code: ProblemCode = ""
    meant: tuple[str, ...] = ()
    line: str = ""
    by: tuple[str, ...] = ()
    in_line: int | None = None

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message

    @property
    def key(self) -> str:
        """Its place within the file."""
        return self.where.rpartition(": ")[2]

    def as_dict(self) -> dict[str, str]:
        """The error as ``--json`` prints it."""
        return {"where": self.where, "message": self.message} | ({"code": self.code} if self.code else {})


def worst_of(codes: Collection[int]) -> int:
    """The exit code of work on many missions: the worst of theirs; 0 if there are none."""
    return next((code for code in WORST if code in codes), 0)


class GcsplanError(Exception):
    """Root of the error tree. ``reason`` is a word for scripts and ``where`` is the place; both may be empty."""

    exit_code: ClassVar[int] = 70
    default_reason: ClassVar[str] = "internal"

    def __init__(self, message: str, *, where: str = "", reason: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.where = where
        self.reason = reason or self.default_reason

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message

    def as_dict(self) -> dict[str, object]:
        """The error as ``--json`` prints it."""
        return {"code": self.exit_code, "reason": self.reason, "message": self.message, "where": self.where}

    def __reduce__(self) -> tuple[Any, ...]:
        # Python's default calls the class with the message alone, and drops or misses the keyword arguments.
        return _revived, (type(self), self.args, self.__dict__)


def _revived(kind: type[GcsplanError], args: tuple[object, ...], state: dict[str, object]) -> GcsplanError:
    """Rebuild an error that came from another process, with the same data."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputError(GcsplanError, ValueError):
    """Bad input of any kind; ``problems`` lists every mistake that was found."""

    exit_code = 2
    default_reason = "bad_input"

    def __init__(self, message: str, *, where: str = "", reason: str = "", problems: Iterable[Mistake] = ()) -> None:
        super().__init__(message, where=where, reason=reason)
        self.problems: tuple[Mistake, ...] = tuple(problems) or (Mistake(where, message),)

    def as_dict(self) -> dict[str, object]:
        """The error as ``--json`` prints it, with each of its problems."""
        return super().as_dict() | {"problems": [p.as_dict() for p in self.problems]}

    @classmethod
    def of(cls, problems: Iterable[Mistake], *, headline: str = "") -> InputError:
        """Make one error of all ``problems`` (at least one), one per line."""
        found = tuple(problems)
        if len(found) == 1 and not headline:
            return cls(found[0].message, where=found[0].where, problems=found)
        head = headline or f"{len(found)} mistakes in the input"
        return cls(head + ":\n" + "\n".join(f"  {p}" for p in found), problems=found)


class UsageError(InputError):
    """The arguments on the command line are wrong."""

    default_reason = "usage"


PATH_KINDS = (str, os.PathLike)
"""The kinds of a path."""


def require_kind(where: str, name: str, value: object, kind: Any, expected: str) -> None:
    """Raise UsageError unless the argument ``name`` is of a ``kind``, which ``expected`` says in words.

    True and False are no numbers, nor is one that no float holds; a path is one that the system can have."""
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    try:
        if fits and isinstance(value, Real):
            float(value)
        if fits and isinstance(value, PATH_KINDS):
            str(value)  # as a path is made of it
        if fits and kind == PATH_KINDS:
            fits = b"\0" not in os.fsencode(value)  # type: ignore[arg-type]
    except Exception:  # OverflowError, UnicodeEncodeError, and whatever a stranger's path raises
        fits = False
    if not fits:
        raise wrong_argument(where, name, value, expected)


def elements(where: str, name: str, value: Any, kind: Any, expected: str) -> tuple[Any, ...]:
    """The elements of an argument that is a sequence of a ``kind``. Raises UsageError."""
    try:
        found = None if isinstance(value, str | bytes | Mapping) else tuple(value)
    except Exception as why:  # it is none, or its own code fails
        raise wrong_argument(where, name, value, expected) from why
    if found is None or not all(isinstance(one, kind) for one in found):
        raise wrong_argument(where, name, value, expected)
    return found


def wrong_argument(where: str, name: str, value: object, expected: str) -> UsageError:
    """The refusal of an argument that is another thing than ``expected`` says."""
    shown = getattr(value, "__name__", None) if isinstance(value, type) or callable(value) else _own_text(value, repr)
    words = f" {shown[:60]}" if isinstance(shown, str) and shown[:1] not in ("", "<") else ""
    given = "None" if value is None else f"{type(value).__name__}{words}"
    return UsageError(f"{name} is {expected}; given {given}", where=where)


def raised(why: Exception) -> str:
    """What a stranger's code raised, in words: the type, and what it says."""
    words = _own_text(why, str)[:300]
    return f"{type(why).__name__}: {words}" if words else type(why).__name__


def _own_text(value: object, of: Callable[[object], str]) -> str:
    """The text that a stranger's object has for itself; empty if its code fails."""
    try:
        return of(value)
    except Exception:  # whatever that code raises, and ValueError for a number of more than 4300 digits
        return ""


LimitValues = tuple[tuple[str, float], ...]
"""Keys of limits, such as ``max_agl_m``, each with a value in SI."""


class NoMission(GcsplanError, RuntimeError):
    """There is no safe mission, and none is better than a wrong one. The message names the binding constraint.

    ``vehicle`` is the vehicle without one, and ``at`` (latitude, longitude in degrees) the place that binds, if there
    is a single one. ``cures``: limits with which a whole mission was planned, each cure by itself.
    """

    exit_code = 3
    default_reason = "not_found"

    def __init__(
        self,
        message: str,
        *,
        reason: NoMissionReason,
        where: str = "",
        vehicle: str = "",
        at: tuple[float, float] | None = None,
        cures: tuple[LimitValues, ...] = (),
    ) -> None:
        super().__init__(message, where=where, reason=reason)
        self.vehicle, self.at, self.cures = vehicle, at, cures


class CheckFailed(GcsplanError, RuntimeError):
    """A mission breaks a limit, or something in it could not be judged.

    ``headline`` says what failed; in the message a line for each place follows it.
    """

    exit_code = 4
    default_reason = "violation"

    def __init__(self, message: str, *, lines: Iterable[str] = (), where: str = "", reason: str = "") -> None:
        super().__init__("\n".join([message, *lines]), where=where, reason=reason)
        self.headline = message


class Cancelled(GcsplanError):
    """The caller ended the work (`cancelled_by`)."""

    exit_code = 130
    default_reason = "cancelled"


_cancelled: ContextVar[Callable[[], bool] | None] = ContextVar("cancelled", default=None)


@contextmanager
def cancelled_by(is_cancelled: Callable[[], bool]) -> Iterator[None]:
    """What runs within, in this thread, ends with `Cancelled` soon after ``is_cancelled`` returns True."""
    token = _cancelled.set(is_cancelled)
    try:
        yield
    finally:
        _cancelled.reset(token)


def heed_cancel() -> None:
    """Raise `Cancelled` if the caller has ended the work: for loops that may take longer than some milliseconds."""
    is_cancelled = _cancelled.get()
    if is_cancelled is not None and is_cancelled():
        raise Cancelled("cancelled by its caller; nothing was written")


class VehicleRefused(GcsplanError, ConnectionError):
    """The vehicle refused, or gcsplan refused to send to it (armed, wrong autopilot, wrong place)."""

    exit_code = 5
    default_reason = "refused"


class LinkError(GcsplanError, ConnectionError):
    """Nobody answers, or the link failed and the outcome of a transfer is unknown."""

    exit_code = 6
    default_reason = "unknown"


class ReadBackDiffers(GcsplanError, RuntimeError):
    """The mission read back from the vehicle is not the one that was sent."""

    exit_code = 7
    default_reason = "differs"


def nearest_name(path: Path) -> str:
    """The name in a file's folder that is nearest to the file's, which is not there; empty if none is near."""
    from difflib import get_close_matches
    from itertools import islice

    try:
        names = [p.name for p in islice(path.parent.iterdir(), MOST_NAMES)]
    except (OSError, ValueError):
        names = []
    return next(iter(get_close_matches(path.name, names, n=1, cutoff=0.75)), "")


def unknown_name(sentence: str, name: str, known: Iterable[str]) -> InputError:
    """The error for a ``name`` that is not in ``known``: ``sentence``, the nearest known name, all known names."""
    from difflib import get_close_matches

    names = list(known)
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return InputError(f"{sentence}.{hint} Known: {', '.join(names) or 'none'}")


@contextmanager
def needs(package: str, what: str) -> Iterator[None]:
    """Around an import: InputError, which says that ``what`` needs ``package`` of gcsplan, where that is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if not f"{package}.".startswith(f"{error.name}."):
            raise
        raise InputError(f"{what} needs {package}, which is not installed: install gcsplan with this package") from None
