"""Values of options that the shell completes. Each function imports what it needs when the shell asks, not before."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable
from typing import get_args

Complete = Callable[[str], list[str]]
"""From what is typed so far to the values that begin with it."""


def words(*known: str) -> Complete:
    """Complete these words."""

    def complete(incomplete: str) -> list[str]:
        return _beginning(incomplete, known)

    return complete


def autopilots(incomplete: str) -> list[str]:
    """The autopilots."""
    from gcsplan.vehicle import Autopilot

    return _beginning(incomplete, Autopilot)


def planners(incomplete: str) -> list[str]:
    """The planners."""
    from gcsplan.planners.registry import names

    return _beginning(incomplete, names())


def encodings(incomplete: str) -> list[str]:
    """A swarm's encodings."""
    from gcsplan.mission_file.values.schema import EncodingName

    return _beginning(incomplete, get_args(EncodingName))


def costs(incomplete: str) -> list[str]:
    """A swarm's costs."""
    from gcsplan.mission_file.values.schema import SwarmCost

    return _beginning(incomplete, get_args(SwarmCost))


def missions(incomplete: str) -> list[str]:
    """The sample missions, and files that begin alike; nothing where a file is meant: the shell completes it."""
    from gcsplan.mission_file.source import SAMPLE_PREFIX, sample_names

    return _with_files(incomplete, SAMPLE_PREFIX, [f"{SAMPLE_PREFIX}{name}" for name in sample_names()])


def dems(incomplete: str) -> list[str]:
    """The sample terrain, and files that begin alike."""
    from gcsplan.world.terrain.sample import SAMPLE

    return _with_files(incomplete, SAMPLE, [SAMPLE])


def _beginning(incomplete: str, known: Iterable[str]) -> list[str]:
    return [str(word) for word in known if str(word).startswith(incomplete)]


def _with_files(incomplete: str, prefix: str, known: Iterable[str]) -> list[str]:
    if not incomplete or not (prefix.startswith(incomplete) or incomplete.startswith(prefix)):
        return []
    return [*sorted(glob.glob(glob.escape(incomplete) + "*")), *_beginning(incomplete, known)]
