"""Settings of a swarm's search: the planner's row, replaced by the options of the mission."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from gcsplan.arrays import Floats
from gcsplan.errors import unknown_name
from gcsplan.planners.registry import VOLUME_KEYS
from gcsplan.research.swarm import PAPER, SwarmEntry


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a search; None stands for the default of the optimiser or of the encoding.

    ``parameters``: the optimiser's, and the sides of the flight volume (`VOLUME_KEYS`). ``earlier``: polylines
    (N, 3) of vehicles that have the right of way and depart at the same time; all fly at ``speed_m_s``. For ants
    ``points`` is the number of sections. ``warm_start``: ``optimal`` (the search begins around that planner's path),
    or the name of a vehicle, whose path is then in ``around`` (N, 3).
    """

    encoding: str = "box"
    cost: str = "krill"
    points: int | None = None
    population: int | None = None
    iterations: int | None = None
    evaluations: int | None = None
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    earlier: Sequence[Floats] = ()
    speed_m_s: float = 15.0
    warm_start: str | None = None
    around: Floats | None = None

    @classmethod
    def of(cls, row: SwarmEntry, options: Mapping[str, object]) -> Settings:
        """Settings of a planner's ``row``, replaced by ``options``. Raises InputError for an unknown key."""
        known = cls.__dataclass_fields__
        for key in options:
            if key not in known:
                raise unknown_name(f"swarm planners know no option {key!r}", key, known)
        given = {key: value for key, value in options.items() if value is not None}
        both = {**row.defaults, **given}
        if given.get("encoding") in (PAPER, row.space.get("encoding")):
            # The paper's number of points belongs to the paper's encoding.
            both = {**row.defaults, **row.space, **given, "encoding": row.space["encoding"]}
        return cls(**both)  # type: ignore[arg-type]

    def split(self) -> tuple[dict[str, float], dict[str, Any]]:
        """The flight volume's sides, and the optimiser's own parameters."""
        volume = {key: float(value) for key, value in self.parameters.items() if key in VOLUME_KEYS}
        return volume, {key: value for key, value in self.parameters.items() if key not in VOLUME_KEYS}
