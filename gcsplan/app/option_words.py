"""The words of a check without a mission file: they name the options that can be given, not a mission file's keys."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from gcsplan.check.rtl.verdict import UnsafeStretch, WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.mission_file.from_options import OPTIONS
from gcsplan.notes.note import Said
from gcsplan.units import UnitText

_KEY = re.compile(r"\b({})\b".format("|".join(key for key in OPTIONS if "_" in key)))
"""Keys that are no English words."""


def in_options(words: Said) -> str:
    """``words`` with ``--rtl-altitude`` in place of ``rtl_rel_home_m``, and so on."""

    def named(piece: str) -> str:
        return _KEY.sub(lambda found: OPTIONS[found[1]], piece)

    return words.changed(named) if isinstance(words, UnitText) else named(str(words))


def all_in_options(lines: Iterable[Said]) -> tuple[str, ...]:
    """Each of ``lines`` in the words of the options."""
    return tuple(in_options(words) for words in lines)


def verdict_in_options(verdict: Verdict) -> Verdict:
    """``verdict`` with its findings, its notes and what was not judged in the words of the options."""
    findings = tuple(replace(f, message=in_options(f.message)) for f in verdict.findings)
    return replace(
        verdict, findings=findings, not_judged=all_in_options(verdict.not_judged), notes=all_in_options(verdict.notes)
    )


def home_in_options(home: WayHome | None) -> WayHome | None:
    """The same for a way home, if there is one."""
    if home is None:
        return None

    def stretches(found: tuple[UnsafeStretch, ...]) -> tuple[UnsafeStretch, ...]:
        return tuple(replace(s, why=in_options(s.why)) for s in found)

    return replace(
        home,
        not_judged=all_in_options(home.not_judged),
        notes=all_in_options(home.notes),
        unsafe=stretches(home.unsafe),
        irregular=stretches(home.irregular),
        left=stretches(home.left),
    )
