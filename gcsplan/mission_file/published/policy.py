"""Which zones of an authority's file are no-fly: what a mission says, and what counts without a word.

Without a word every zone that restricts is no-fly. A zone is not used only for a reason, which is named.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from gcsplan.errors import Mistake
from gcsplan.mission_file.published.times import Hours, Period, apply_in
from gcsplan.mission_file.values.schema import nearest
from gcsplan.mission_file.zones.draft import Remark
from gcsplan.mission_file.zones.file import Ignorable, OnBad
from gcsplan.notes.note import Note

UNREAD_TIMES = Note("zone_times_not_understood")

_KINDS_SHOWN = 12


@dataclass(frozen=True, slots=True)
class Policy:
    """A mission's rules for one file: ``kinds`` that are no-fly, zones that it is ``authorised`` to enter, its hours.

    ``flight_level_error_m`` is how far flight levels may lie from their heights above sea level; None: they limit
    nothing. ``on_bad`` is the rule for elements that are not understood (None: by the file's format), ``ignore``
    has the shapes beside zones that are left out. ``where`` is the place of the entry in the mission file, or the
    option ``--zones``.
    """

    kinds: tuple[str, ...] | None = None
    authorised: tuple[str, ...] = ()
    hours: Hours | None = None
    flight_level_error_m: float | None = None
    where: str = ""
    on_bad: OnBad | None = None
    ignore: tuple[Ignorable, ...] = ()

    @property
    def by_options(self) -> bool:
        """Whether a command's options stand for the keys of an entry."""
        return self.where.startswith("--")

    def place_of(self, key: str, option: str) -> str:
        """The place of a key for messages: the key of the entry, or the option that stands for it."""
        return option if self.by_options else f"{self.where}.{key}"

    @property
    def keys(self) -> list[str]:
        """The keys that only files of authorities have, as far as the mission has them."""
        given = {
            "kinds": self.kinds is not None,
            "authorised": bool(self.authorised),
            "flight_level_error_m": self.flight_level_error_m is not None,
        }
        return [key for key, is_given in given.items() if is_given]


@dataclass(frozen=True, slots=True)
class Published:
    """One zone as its authority publishes it; ``kinds`` are its published words, in upper case.

    ``restricts``: whether it is no-fly without a policy. Without ``periods`` it applies always. ``unread`` says what of
    the kinds is not understood: it then counts as no-fly, whichever kinds are.
    """

    name: str
    kinds: tuple[str, ...]
    restricts: bool = True
    identifier: str = ""
    periods: tuple[Period, ...] = ()
    remarks: tuple[Remark, ...] = ()
    unread: tuple[str, ...] = ()


@dataclass
class PolicyJudge:
    """Applies a policy to the zones of one file; ``vocabulary`` are the kinds that its format has."""

    policy: Policy
    vocabulary: Collection[str]
    kinds: set[str] = field(default_factory=set)
    entered: set[str] = field(default_factory=set)

    def reason(self, zone: Published) -> Note | None:
        """Why the zone is not used; None if it is."""
        self.kinds |= set(zone.kinds)
        own = {name for name in self.policy.authorised if name in (zone.identifier, zone.name)}
        self.entered |= own
        kinds = None if zone.unread else self.policy.kinds
        if kinds is not None and not {_plain(k) for k in kinds} & {_plain(k) for k in zone.kinds}:
            return Note("zones_of_other_kinds", kinds=kinds[:_KINDS_SHOWN])
        if kinds is None and not zone.restricts and not zone.unread:
            return Note("zones_restrict_nothing")
        if own:
            return Note("zones_authorised")
        if not apply_in(zone.periods, self.policy.hours):
            return Note("zones_out_of_hours", hours=str(self.policy.hours))
        return None

    def slips(self) -> list[Mistake]:
        """Names of the policy that fit nothing: a slip would leave zones out, or not let a zone be entered."""
        known = sorted({_plain(k) for k in (*self.vocabulary, *self.kinds)})
        found = [
            Mistake(f"{self.policy.where}.kinds[{i}]", _unknown("kind", kind, known))
            for i, kind in enumerate(self.policy.kinds or ())
            if _plain(kind) not in known
        ]
        return found + [
            Mistake(f"{self.policy.where}.authorised[{i}]", f"no zone of the file has the identifier or name {name!r}")
            for i, name in enumerate(self.policy.authorised)
            if name not in self.entered
        ]


def _unknown(what: str, given: str, known: list[str]) -> str:
    near = nearest(_plain(given), known) or f"; known are {', '.join(known)}"
    return f"the file has no {what} {given[:60]!r}{near}"


def _plain(kind: str) -> str:
    """A kind without regard to case; ED-269 and ED-318 spell authorisation differently."""
    return kind.strip().upper().replace("AUTHORIZATION", "AUTHORISATION")
