"""Vehicles, limits, energy and order of arrival from the keys of a mission file: everything that needs no terrain.

Of a vehicle's energy, power in cruise and endurance become a base power (`make_energy`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from gcsplan.errors import Mistake
from gcsplan.figures import floored
from gcsplan.fleet.motion.ardupilot import lean_needed_deg
from gcsplan.mission_file.request import ArrivalRequest
from gcsplan.mission_file.values.schema import ArrivalKeys, EnergyKeys, LimitKeys, VehicleKeys, nearest
from gcsplan.notes.note import Note
from gcsplan.vehicle import (
    DEFAULT_LEAN_DEG,
    GRAVITY_M_S2,
    LARGEST_LEAN_DEG,
    PX4_VEL_MAX_M_S,
    Autopilot,
    ClimbOut,
    Energy,
    Vehicle,
    fastest_at_m_s,
    lean_for_deg,
    lean_words,
)
from gcsplan.wind.declared import DeclaredWind
from gcsplan.world.geometry.limits import Limits

ERRORS = {"horizontal_clearance_m": 30.0, "track_error_m": 3.0, "altitude_error_m": 5.0}
"""Defaults in metres for a mission on the real Earth; in local metres the defaults are 0."""

PLANE_CLIMB_DEG = 15.0
"""Default steepest climb of an ArduPlane: a fixed wing cannot climb at any angle."""

STEEPEST_WING_DEG = 45.0

MOST_BANK_DEG = 45.0
"""ArduPlane's default of ROLL_LIMIT_DEG."""


SEPARATION_M = 30.0

CURE_ROUNDING_M = 0.05
"""At least what planners keep beyond the errors, since altitudes are stored in centimetres; for advice alone."""

MOTION = (
    "climb_m_s", "descent_m_s", "land_m_s", "accel_m_s2", "corner_accel_m_s2", "vertical_accel_m_s2", "leg_jerk_m_s3",
)  # fmt: skip
"""The keys that bound a vehicle's motion besides its cruise speed. In local metres (the papers' worlds) an absent key
is no bound: speed changes at once, and counts in space."""

PX4_MOTION = {"climb_m_s": 3.0, "land_m_s": 0.7, "accel_m_s2": 3.0, "corner_accel_m_s2": 1.5, "leg_jerk_m_s3": 4.0}
"""The values of `MOTION` that differ on PX4: the defaults of MPC_Z_V_AUTO_UP, MPC_LAND_SPEED, MPC_ACC_HOR,
MPC_XY_TRAJ_P · MPC_ACC_HOR and MPC_JERK_AUTO."""


def check_unique(vehicles: Sequence[Any], where: str, problems: list[Mistake]) -> tuple[str, ...]:
    """Report duplicate names and system ids among the vehicles as written; returns the names.

    Names must differ by more than upper and lower case, because they become file names. A system id is that of one
    vehicle on each link: vehicles that share one, as more than 255 must, have different links.
    """
    names: dict[str, int] = {}
    sysids: dict[int, dict[str | None, int]] = {}
    for i, keys in enumerate(vehicles):
        name, sysid = (keys.get("name"), keys.get("sysid")) if isinstance(keys, dict) else (None, None)
        if isinstance(name, str):
            first = names.setdefault(name.lower(), i)
            if first != i:
                problems.append(
                    Mistake(f"{where}[{i}].name", f"{name[:64]!r} is the name of vehicles[{first}] already; change one")
                )
        if isinstance(sysid, int) and not isinstance(sysid, bool):
            link = keys.get("link")
            others = sysids.setdefault(sysid, {})
            if others and (not isinstance(link, str) or link in others or None in others):
                first = others.get(link, next(iter(others.values())))
                cure = "change one, or give each of them a `link` of its own"
                problems.append(
                    Mistake(f"{where}[{i}].sysid", f"{sysid} is the system id of vehicles[{first}] already; {cure}")
                )
            others.setdefault(link if isinstance(link, str) else None, i)
    return tuple(k["name"] for k in vehicles if isinstance(k, dict) and isinstance(k.get("name"), str))


def make_vehicle(
    keys: VehicleKeys, shared: LimitKeys, where: str, problems: list[Mistake], notes: list[Note],
    *, local: bool, obstacle_m: float,
) -> Vehicle | None:  # fmt: skip
    """A vehicle with its limits merged: the file's, overridden by its own. None, and ``problems``, if it is wrong.

    ``notes`` gets the notes on how its keys were read, without its name.

    ``obstacle_m`` is the obstacle height that applies everywhere; it is added to min AGL in the least take-off height.
    """
    before = len(problems)
    limits = _limits(keys, shared, where, problems, notes, local=local)
    slow, fast = keys.speed_m_s
    keys, vtol = _on_its_wing(keys, where, problems)
    if slow > fast:
        words = f"the slowest speed must not be above the fastest, given [{slow:g}, {fast:g}]"
        problems.append(Mistake(f"{where}.speed_m_s", words))
    if keys.turn_radius_m > 0.0:
        _check_wing(keys, limits, where, problems)
    if keys.end == "rtl" and keys.rtl_rel_home_m is None:
        problems.append(
            Mistake(
                f"{where}.rtl_rel_home_m",
                "is missing: end: rtl needs the height above home that the vehicle returns at (its own parameter)",
                "missing",
            )
        )
    if limits is not None:
        _check_heights(keys, limits, where, problems, obstacle_m)
    climb_out = _climb_out(keys, limits, where, problems, vtol=vtol)
    energy = make_energy(keys, where, problems, notes)
    if len(problems) > before or limits is None:
        return None
    return Vehicle(
        name=keys.name, sysid=keys.sysid, autopilot=Autopilot(keys.autopilot), limits=limits,
        speed_min_m_s=slow, speed_max_m_s=fast, turn_radius_m=keys.turn_radius_m,
        energy=energy, link=keys.link, climb_out=climb_out, vtol=vtol,
        **(_wing_motion(keys, limits, vtol=vtol) if keys.turn_radius_m > 0.0 else _motion(keys, local=local)),
    )  # fmt: skip


VTOL_BANK_DEG = 30.0
"""The bank of a VTOL's turns at its fastest speed, if its radius is not given."""


def _on_its_wing(keys: VehicleKeys, where: str, problems: list[Mistake]) -> tuple[VehicleKeys, bool]:
    """The keys with the radius of a VTOL's turns, and whether the vehicle is a VTOL: in a mission ArduPlane flies its
    way points on its wing, whatever it takes off with (quadplane.cpp, `in_vtol_auto`)."""
    plane, radius_m = keys.autopilot == "arduplane", keys.turn_radius_m
    if keys.vtol is not None and (not plane or not (keys.vtol or radius_m)):
        cure = "give its turn_radius_m" if plane else "leave it out, or use autopilot: arduplane"
        problems.append(Mistake(f"{where}.vtol", f"{cure}, given {str(keys.vtol).lower()} for {keys.autopilot}"))
    vtol = plane and (not radius_m if keys.vtol is None else keys.vtol)
    if vtol and not radius_m:
        radius_m = math.ceil(keys.speed_m_s[1] ** 2 / GRAVITY_M_S2 / math.tan(math.radians(VTOL_BANK_DEG)))
    if vtol and keys.climb_out != "straight":
        problems.append(Mistake(f"{where}.climb_out", "a VTOL takes off vertically: leave it out, given circles"))
    return keys.model_copy(update={"turn_radius_m": radius_m}), vtol


WIND_COURSES = 72
"""Courses, evenly all around, for which a fixed wing knows the strongest wind along them."""


def in_wind(vehicle: Vehicle, wind: DeclaredWind) -> Vehicle:
    """A vehicle in the winds that its mission declares: a fixed wing with limits that hold over ground in each, a PX4
    with its default lean if none is given.

    A wind adds to the speed over ground and not to the climb: slopes are less steep with the strongest wind behind.
    """
    if wind.still:
        return vehicle
    if not vehicle.keeps_airspeed:
        return replace(vehicle, lean_angle_deg=vehicle.largest_lean_deg)
    courses_rad = 2.0 * np.pi * np.arange(WIND_COURSES) / WIND_COURSES
    limits, blows_m_s = vehicle.limits, tuple(wind.along_m_s(courses_rad).tolist())
    blown = replace(vehicle, blows_m_s=blows_m_s, climbs_deg=limits.max_climb_deg)
    up, down = (
        floored(math.degrees(math.atan(slope * blown.tail_ratio)), 2)
        for slope in (limits.max_climb_slope, limits.max_descent_slope)
    )
    return replace(blown, limits=replace(limits, max_climb_deg=up, max_descent_deg=down))


def slopes_in_wind(vehicle: Vehicle) -> Note:
    """How steep a fixed wing flies over ground in the declared winds."""
    limits = vehicle.limits
    return Note(
        "slopes_in_wind", vehicle=vehicle.name, climb_deg=limits.max_climb_deg, descent_deg=limits.max_descent_deg,
        speed_m_s=vehicle.speed_min_m_s, wind_m_s=vehicle.wind_m_s,
    )  # fmt: skip


def within_lean(
    vehicle: Vehicle, keys: VehicleKeys, where: str, problems: list[Mistake], notes: list[Note], *, local: bool
) -> Vehicle:
    """``vehicle`` with the speeds that its lean angle allows, and a note if that is less than its keys want.

    In local metres (the papers' worlds) an absent key is no bound, nor is it for a PX4.
    """
    lean_deg = keys.lean_angle_deg
    if vehicle.autopilot is Autopilot.ARDUPLANE:
        problems += _of_another(vehicle, "a multicopter", f"{where}.lean_angle_deg", lean_deg)
        return vehicle
    if lean_deg is None and (local or vehicle.autopilot is Autopilot.PX4):
        return vehicle
    leans_deg = DEFAULT_LEAN_DEG if lean_deg is None else lean_deg
    most, planned_m_s = fastest_at_m_s(leans_deg), vehicle.speed_max_m_s
    if planned_m_s > most:
        needs_deg = max(math.ceil(lean_for_deg(planned_m_s) - 1e-6), round(lean_needed_deg(planned_m_s)))
        curable = needs_deg <= LARGEST_LEAN_DEG
        notes.append(
            Note(
                "lean_bounds_speed_curably" if curable else "lean_bounds_speed", most_m_s=most, wanted_m_s=planned_m_s,
                lean_deg=leans_deg, by_default=lean_deg is None, needs_deg=needs_deg,
                setting=lean_words(needs_deg, vehicle.autopilot),
            )
        )  # fmt: skip
    return _no_faster(replace(vehicle, lean_angle_deg=leans_deg), most)


def within_vel_max(
    vehicle: Vehicle, keys: VehicleKeys, where: str, problems: list[Mistake], notes: list[Note], *, local: bool
) -> Vehicle:
    """``vehicle`` with the speeds that PX4's MPC_XY_VEL_MAX allows, and a note if that is less than its keys want.

    In local metres (the papers' worlds) an absent key is no bound.
    """
    most = keys.mpc_xy_vel_max_m_s
    if vehicle.autopilot is not Autopilot.PX4:
        problems += _of_another(vehicle, "PX4", f"{where}.mpc_xy_vel_max_m_s", most)
        return vehicle
    if most is None and local:
        return vehicle
    own = PX4_VEL_MAX_M_S if most is None else most
    planned_m_s = vehicle.speed_max_m_s
    if planned_m_s > own:
        notes.append(Note("velocity_bounds_speed", most_m_s=own, wanted_m_s=planned_m_s, by_default=most is None))
    return _no_faster(replace(vehicle, vel_max_m_s=own), own)


def _of_another(vehicle: Vehicle, owner: str, where: str, value: float | None) -> list[Mistake]:
    """The problem of a key that only the autopilot ``owner`` has, if it is given for this vehicle."""
    if value is None:
        return []
    return [Mistake(where, f"is {owner}'s alone: leave it out for {vehicle.autopilot}, given {value:g}")]


def _no_faster(vehicle: Vehicle, most_m_s: float) -> Vehicle:
    """``vehicle`` with speeds of at most ``most_m_s``."""
    return replace(
        vehicle, speed_max_m_s=min(vehicle.speed_max_m_s, most_m_s), speed_min_m_s=min(vehicle.speed_min_m_s, most_m_s)
    )


def _check_wing(keys: VehicleKeys, limits: Limits | None, where: str, problems: list[Mistake]) -> None:
    """Check a vehicle with a turn radius: only ArduPlane begins turns where the mission says."""
    radius, at = keys.turn_radius_m, f"{where}.turn_radius_m"
    if keys.autopilot == "arducopter":
        words = f"a multicopter has no turn radius: use 0, or autopilot: arduplane for a fixed wing, given {radius:g}"
        problems.append(Mistake(at, words))
        return
    if keys.autopilot == "px4":
        words = (
            f"px4 begins a fixed wing's turns at a distance of its own and not at the mission's, so its arcs cannot be "
            f"vouched for: use autopilot: arduplane, or 0 for a multicopter, given {radius:g}"
        )
        problems.append(Mistake(at, words))
        return
    bank_deg = math.degrees(math.atan(keys.speed_m_s[1] ** 2 / (GRAVITY_M_S2 * radius)))
    if bank_deg > MOST_BANK_DEG:
        least = math.ceil(keys.speed_m_s[1] ** 2 / GRAVITY_M_S2 / math.tan(math.radians(MOST_BANK_DEG)))
        words = (
            f"turns of {radius:g} m at {keys.speed_m_s[1]:g} m/s need a bank of {bank_deg:.0f}°, and ArduPlane's "
            f"ROLL_LIMIT_DEG is {MOST_BANK_DEG:g}°: give at least {least}, or a lower speed"
        )
        problems.append(Mistake(at, words))
    if limits is not None and not 1.0 <= limits.max_climb_deg <= STEEPEST_WING_DEG:
        words = f"a fixed wing climbs at 1 to {STEEPEST_WING_DEG:g}°, given {limits.max_climb_deg:g}"
        problems.append(Mistake(f"{where}.max_climb_deg", words))
    if limits is not None and limits.max_descent_deg > STEEPEST_WING_DEG:
        words = f"a fixed wing descends at {STEEPEST_WING_DEG:g}° at most, given {limits.max_descent_deg:g}"
        problems.append(Mistake(f"{where}.max_descent_deg", words))


def _climb_out(
    keys: VehicleKeys, limits: Limits | None, where: str, problems: list[Mistake], *, vtol: bool
) -> ClimbOut | None:
    """A fixed wing's climb-out, if the file states one; it must not be less steep than its climb-out is judged."""
    rate, speed = keys.climb_out_m_s, keys.climb_out_speed_m_s
    if rate is None:
        if speed is not None:
            problems.append(
                Mistake(
                    f"{where}.climb_out_m_s", "is missing; climb_out_speed_m_s is the speed of its climb", "missing"
                )
            )
        return None
    if keys.turn_radius_m <= 0.0 or vtol:
        words = f"is a fixed wing's, which has a turn_radius_m above 0: leave it out, or use climb_m_s, given {rate:g}"
        problems.append(Mistake(f"{where}.climb_out_m_s", words))
        return None
    fast = keys.speed_m_s[1]
    if speed is None and rate >= fast:
        words = f"must be below the fastest speed {fast:g}, or climb_out_speed_m_s be given too, given {rate:g}"
        problems.append(Mistake(f"{where}.climb_out_m_s", words))
        return None
    over_ground = math.sqrt(fast * fast - rate * rate) if speed is None else speed
    steep_deg = math.degrees(math.atan2(rate, over_ground))
    if limits is not None and steep_deg < math.floor(limits.max_climb_deg + 1e-9):
        words = (
            f"at {over_ground:.1f} m/s over ground is a climb of {steep_deg:.1f}°, and the climb-out is judged at "
            f"max_climb_deg {limits.max_climb_deg:g}, which the aircraft does not reach: "
        )
        least = math.floor(steep_deg)
        words += f"write max_climb_deg: {least}" if least >= 1 else "it needs more power"
        problems.append(Mistake(f"{where}.climb_out_m_s", words))
        return None
    return ClimbOut(rate, over_ground)


def _wing_motion(keys: VehicleKeys, limits: Limits, *, vtol: bool) -> dict[str, Any]:
    """Rates of a fixed wing: its speed is constant, so they follow from the slope limits unless they are given. A VTOL
    takes off and lands with those of a multicopter, and speeds up and brakes in between."""
    fast = keys.speed_m_s[1]
    rates = {
        "climb_m_s": fast * limits.max_climb_slope,
        "descent_m_s": fast * limits.max_descent_slope,
    }
    own = {key: getattr(keys, key) for key in rates if key in keys.model_fields_set}
    lifts = {key: getattr(keys, key) for key in ("accel_m_s2", "vertical_accel_m_s2", "land_m_s") if vtol}
    free = {key: math.inf for key in MOTION if key.endswith(("_m_s2", "_m_s3"))} | {"land_m_s": math.inf}
    return free | lifts | rates | own


def unbounded_motion(keys: VehicleKeys, *, local: bool) -> tuple[str, ...]:
    """The keys of a copter's motion that bound nothing: in local metres those that are not given."""
    if not local or keys.turn_radius_m > 0.0:
        return ()
    return tuple(key for key in MOTION if key not in keys.model_fields_set)


def _motion(keys: VehicleKeys, *, local: bool) -> dict[str, float]:
    free = unbounded_motion(keys, local=local)
    own = {k: v for k, v in PX4_MOTION.items() if keys.autopilot == "px4" and k not in keys.model_fields_set}
    return {key: math.inf if key in free else own.get(key, getattr(keys, key)) for key in MOTION}


def _limits(
    keys: VehicleKeys, shared: LimitKeys, where: str, problems: list[Mistake], notes: list[Note], *, local: bool
) -> Limits | None:
    names = tuple(LimitKeys.model_fields)
    own = {k: v for k, v in keys.given.items() if k in names}
    nested = keys.limits.given if keys.limits is not None else {}
    for key in sorted(own.keys() & nested.keys()):
        problems.append(Mistake(f"{where}.{key}", f"stands in limits.{key} too; keep one"))
    merged: dict[str, Any] = shared.given | nested | own
    if merged.get("min_agl_m") is None:
        problems.append(Mistake(f"{where}.min_agl_m", "is missing; give it here or in limits", "missing_limit"))
        return None
    for key, default in ERRORS.items():
        if merged.get(key) is None:
            merged[key] = 0.0 if local else default
            if not local:
                notes.append(Note("limit_assumed", limit=key, value=default))
    merged["vertical_clearance_m"] = merged.get("vertical_clearance_m") or 0.0
    if merged.get("max_climb_deg") is None:
        merged["max_climb_deg"] = 90.0
        if keys.autopilot == "arduplane":
            merged["max_climb_deg"] = PLANE_CLIMB_DEG
            notes.append(Note("plane_climb_assumed", climb_deg=PLANE_CLIMB_DEG))
    if merged.get("max_descent_deg") is None:
        merged["max_descent_deg"] = merged["max_climb_deg"]
    return Limits(**{f.name: merged.get(f.name) for f in fields(Limits)})  # type: ignore[arg-type]


def _check_heights(keys: VehicleKeys, limits: Limits, where: str, problems: list[Mistake], obstacle_m: float) -> None:
    """Check that max AGL leaves room above min AGL, and that take-off, approach and via heights are within it."""
    error_m = limits.altitude_error_m
    low = limits.min_agl_m + error_m + obstacle_m
    words = f"min_agl_m {limits.min_agl_m:g} + altitude_error_m {error_m:g}"
    if obstacle_m > 0.0:
        words += f" + obstacle_height_m {obstacle_m:g}"
    high = float("inf")
    if limits.max_agl_m is not None:
        high = limits.max_agl_m - error_m
        if low > high + 1e-9:
            above = limits.min_agl_m > limits.max_agl_m
            message = f"min_agl_m must not be above max_agl_m, given {limits.min_agl_m:g} and {limits.max_agl_m:g}; "
            if not above:
                message = f"leaves no room: {words} is above max_agl_m {limits.max_agl_m:g} - "
                message += f"altitude_error_m {error_m:g}; "
            message += f"write max_agl_m {math.ceil(low + error_m + CURE_ROUNDING_M)} or more"
            lower_m = math.floor(limits.min_agl_m + high - low - CURE_ROUNDING_M)
            message += f", or min_agl_m {lower_m} or less" if lower_m > 0 else ""
            key = "min_agl_m" if above else "max_agl_m"
            problems.append(Mistake(f"{where}.{key}", message, by=("max_agl_m", "min_agl_m")))
            return
    heights = [("takeoff_agl_m", keys.takeoff_agl_m), ("approach_agl_m", keys.approach_agl_m)]
    for i, point in enumerate(keys.via):
        heights.append((f"via[{i}]", point.agl_m))
    for key, agl_m in heights:
        if agl_m is None:
            continue
        if agl_m < low - 1e-9:
            problems.append(
                Mistake(
                    f"{where}.{key}", f"must be at least {low:g} m AGL ({words}), given {agl_m:g}", by=("min_agl_m",)
                )
            )
        elif agl_m > high + 1e-9:
            most = f"must be at most {high:g} m AGL (max_agl_m - altitude_error_m), given {agl_m:g}"
            most += f"; write {math.floor(high - CURE_ROUNDING_M)} or less"
            problems.append(Mistake(f"{where}.{key}", most, by=("max_agl_m",)))


def make_arrival(
    keys: ArrivalKeys | None, names: Collection[str], where: str, problems: list[Mistake]
) -> ArrivalRequest | None:
    """The fleet's arrival; ``names`` are the vehicles' names as written."""
    if keys is None:
        return None
    order = keys.order if isinstance(keys.order, list) else list(names)
    for i, name in enumerate(order):
        if name not in names:
            problems.append(Mistake(f"{where}.order[{i}]", f"no vehicle is named {name[:64]!r}{nearest(name, names)}"))
        elif name in order[:i]:
            problems.append(Mistake(f"{where}.order[{i}]", f"{name!r} stands twice"))
    missing = [n for n in names if n not in order]
    if missing and all(name in names for name in order):  # a name that is wrong stands for one that is missing
        problems.append(Mistake(f"{where}.order", f"must name every vehicle, missing: {', '.join(missing)[:200]}"))
    if keys.mode == "sequence" and keys.interval_s is None:
        words = "is missing: seconds between one arrival and the next"
        problems.append(Mistake(f"{where}.interval_s", words, "missing"))
    if keys.mode == "none":
        unused = [k for k in ("arrive_s", "clock", "hold") if getattr(keys, k) is not None and k in keys.given]
        problems += [Mistake(f"{where}.{k}", "counts with mode: sequence or together only") for k in unused]
    if keys.clock is not None and keys.arrive_s is not None:
        problems.append(Mistake(f"{where}.clock", "arrive_s sets the time of the first already; keep one"))
    elif keys.clock is not None and keys.mode == "together":
        problems.append(
            Mistake(f"{where}.clock", "counts with mode: sequence only; together the slowest sets the time")
        )
    return ArrivalRequest(
        keys.mode, tuple(order), keys.interval_s or 0.0,
        SEPARATION_M if keys.separation_m is None else keys.separation_m, best_order=keys.order == "best",
        arrive_s=keys.arrive_s, clock=keys.clock, hold=keys.hold, window_s=keys.window_s,
        pad_clear_s=keys.pad_clear_s, leave_out=keys.leave_out,
        gates=None if isinstance(keys.gates, list) else keys.gates,
    )  # fmt: skip


WAYS = (("base_w", "horizontal_j_per_m"), ("cruise_w",), ("endurance_s",))
"""Keys that say what cruising takes, by way: a file may give the keys of one way alone."""


def make_energy(keys: VehicleKeys, where: str, problems: list[Mistake], notes: list[Note]) -> Energy:
    """The energy model of a vehicle; ``problems`` if its keys contradict each other.

    Without any key under ``energy:`` it is the paper's, marked as not stated; with a battery alone, as the paper's.
    """
    given = keys.energy
    used = [[key for key in way if key in given.model_fields_set and getattr(given, key) is not None] for way in WAYS]
    stated = [found for found in used if found]
    if len(stated) > 1:
        first, second = stated[0][0], stated[1][0]
        problems.append(
            Mistake(
                f"{where}.energy.{second}",
                f"says what cruising takes, and {first} says it too, in another way: keep one of them",
            )
        )
    if given.endurance_s is not None and given.battery_j is None:
        problems.append(
            Mistake(
                f"{where}.energy.endurance_s",
                "needs the energy that lasts so long: give battery_wh too, or cruise_w instead",
            )
        )
    speeds = given.fitted_speed_m_s
    if speeds is not None and speeds[0] > speeds[1]:
        words = f"the slowest speed must not be above the fastest, given [{speeds[0]:g}, {speeds[1]:g}]"
        problems.append(Mistake(f"{where}.energy.fitted_speed_m_s", words))
    base_w, along = given.base_w, given.horizontal_j_per_m
    papers = bool(given.model_fields_set) and not stated and "vertical_j_per_m" not in given.model_fields_set
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
        papers=papers, endurance_s=given.endurance_s,
    )  # fmt: skip


def _unsaid(given: EnergyKeys) -> list[str]:
    """The numbers that count as in the paper, because they are not given."""
    return [key for key in ("vertical_j_per_m", "horizontal_j_per_m") if key not in given.model_fields_set]


def _cruise_w(given: EnergyKeys) -> float | None:
    """The power in cruise that is stated, W; None if none is."""
    if given.cruise_w is not None:
        return given.cruise_w
    if given.endurance_s is not None and given.battery_j is not None:
        return given.battery_j / given.endurance_s
    return None


def one_speed(given: Mapping[str, Any], keys: VehicleKeys) -> list[Note]:
    """A note if one number stands for the slowest and the fastest speed."""
    if isinstance(given.get("speed_m_s"), list | None):
        return []
    slow, fast = keys.speed_m_s
    return [Note("one_speed", slow_m_s=slow, fast_m_s=fast)]
