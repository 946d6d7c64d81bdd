"""The terrain and zones of a mission in another process: sent as the mission's content, read there once, kept.

What is read must be what the sender has read: hashes of terrain and zones are compared.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from dataclasses import dataclass

from gcsplan.app.parallel.executor import require_same_inputs
from gcsplan.errors import InputError
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.request import Content, MissionFile
from gcsplan.world.airspace import Airspace
from gcsplan.world.world import World

__all__ = ["Site", "site_of", "world_of"]

_read: dict[str, tuple[MissionFile, World]] = {}
"""The mission that this process has read for others; the last one only, for terrain is large."""


def world_of(source: MissionFile) -> World:
    """The frame and airspace of a mission file."""
    return World(source.frame, Airspace(source.surface, source.zones, scale=source.airspace_scale))


@dataclass(frozen=True, slots=True)
class Site:
    """A mission's content, what its terrain and zones must be, and how often its terrain was widened."""

    content: Content
    inputs: Mapping[str, object]
    level: int
    key: str

    def read(self) -> tuple[MissionFile, World]:
        """The mission and its world, from the files that this process sees. Raises InputError if they are others."""
        known = _read.get(self.key)
        if known is not None:
            return known
        source = load_content(self.content)
        if self.level:
            source = widened(source, self.level)
        require_same_inputs(source.inputs, self.inputs, str(source.path))
        _read.clear()
        return _read.setdefault(self.key, (source, world_of(source)))


def site_of(source: MissionFile) -> Site:
    """The data with which another process reads a mission's terrain and zones."""
    assert source.content is not None
    key = hashlib.sha256(pickle.dumps((source.content, source.inputs, source.level))).hexdigest()
    return Site(source.content, source.inputs, source.level, key)


def widened(source: MissionFile, level: int) -> MissionFile:
    """The mission over the terrain of a level. Raises InputError if that cannot be read here."""
    found = source.at_level(level) if source.at_level is not None else source if level == source.level else None
    if found is None:
        raise InputError("the terrain that the plan was made over cannot be read here", where=str(source.path))
    return found
