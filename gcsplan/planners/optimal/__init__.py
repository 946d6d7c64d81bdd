"""The planner `optimal`: paths below altitude caps, and a bound that no path can beat; its entry point is `planner`."""

from __future__ import annotations

from types import MappingProxyType

from gcsplan.planners.registry import PlannerEntry


def entry(name: str) -> PlannerEntry:
    """The row of `optimal`, the only planner here."""
    return PlannerEntry(
        name=name,
        summary="exact shortest tracks under altitude caps, taut-string profiles, and a bound that no path can beat",
        module="gcsplan.planners.optimal.planner",
        defaults=MappingProxyType({"gap_percent": 0.1, "budget_s": 10.0}),
        options=("without",),
    )
