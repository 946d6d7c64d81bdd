"""A vehicle's energy from the keys of a mission file: power in cruise and endurance become a base power."""

from __future__ import annotations

from gcsplan.errors import Problem
from gcsplan.mission_file.values.schema import EnergyKeys, VehicleKeys
from gcsplan.notes.note import Note
from gcsplan.vehicle import Energy

__all__ = ["make_energy"]

WAYS = (("base_w", "horizontal_j_per_m"), ("cruise_w",), ("endurance_s",))
"""Keys that say what cruising takes: those of one way alone may be given."""


def make_energy(keys: VehicleKeys, where: str, problems: list[Problem], notes: list[Note]) -> Energy:
    """The energy model of a vehicle; ``problems`` if its keys contradict each other.

    Without any key under ``energy:`` it is the paper's, marked as not stated; with a battery alone, as the paper's.
    """
    given = keys.energy
    used = [[key for key in way if key in given.model_fields_set and getattr(given, key) is not None] for way in WAYS]
    said = [found for found in used if found]
    if len(said) > 1:
        first, second = said[0][0], said[1][0]
        problems.append(
            Problem(
                f"{where}.energy.{second}",
                f"says what cruising takes, and {first} says it too, in another way: keep one of them",
            )
        )
    if given.endurance_s is not None and given.battery_j is None:
        problems.append(
            Problem(
                f"{where}.energy.endurance_s",
                "needs the energy that lasts so long: give battery_wh too, or cruise_w instead",
            )
        )
    speeds = given.fitted_speed_m_s
    if speeds is not None and speeds[0] > speeds[1]:
        words = f"the slowest speed must not be above the fastest, given [{speeds[0]:g}, {speeds[1]:g}]"
        problems.append(Problem(f"{where}.energy.fitted_speed_m_s", words))
    base_w, along = given.base_w, given.horizontal_j_per_m
    papers = bool(given.model_fields_set) and not said and "vertical_j_per_m" not in given.model_fields_set
    if (cruise_w := _cruise_w(given)) is not None:
        base_w, along = cruise_w, 0.0
        key = "cruise_w" if given.cruise_w is not None else "endurance_s"
        climbs = "vertical_j_per_m" in given.model_fields_set
        notes.append(
            Note(
                "cruise_is_base_power" if climbs else "cruise_is_base_power_climb_of_paper", given_key=key,
                given=getattr(given, key), base_w=base_w, vertical_j_per_m=given.vertical_j_per_m,
            )
        )  # fmt: skip
    elif given.model_fields_set and not papers and (unsaid := _unsaid(given)):
        costs = tuple(Note("key_and_value", name=key, value=getattr(given, key)) for key in unsaid)
        notes.append(Note("energy_in_part_of_paper", costs=costs))
    if given.hover_w and given.hover_w < base_w:
        notes.append(Note("hover_below_base_power", hover_w=given.hover_w, base_w=base_w))
    return Energy(
        vertical_j_per_m=given.vertical_j_per_m, horizontal_j_per_m=along, hover_w=given.hover_w,
        battery_j=given.battery_j, reserve=given.reserve, battery_v=given.battery_v, base_w=base_w,
        fitted_m_s=None if speeds is None else (speeds[0], speeds[1]), stated=bool(given.model_fields_set),
        papers=papers,
    )  # fmt: skip


def _unsaid(given: EnergyKeys) -> list[str]:
    """What counts as in the paper, because it is not given."""
    return [key for key in ("vertical_j_per_m", "horizontal_j_per_m") if key not in given.model_fields_set]


def _cruise_w(given: EnergyKeys) -> float | None:
    """The power in cruise that is stated, W; None if none is."""
    if given.cruise_w is not None:
        return given.cruise_w
    if given.endurance_s is not None and given.battery_j is not None:
        return given.battery_j / given.endurance_s
    return None
