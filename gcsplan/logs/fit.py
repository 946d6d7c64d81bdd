"""Fit R1, R2 and hover power to flown energy: the cost of a vertical metre, a horizontal metre and a second of hover.

The model is that of `gcsplan.vehicle.Energy`, with which missions are planned: a step of the flight takes R1 times its
vertical metres plus R2 times its horizontal ones, and hover power times its seconds of hovering. The fit is weighted
least squares over steps of a few seconds, robust by Huber's weights, with no coefficient below 0. A coefficient is
reported only if the log determines it: enough of its motion was flown, the other columns do not explain its column, and
its 95 % interval is narrow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog

STEP_S = 5.0
"""Length of a step: long enough that height noise is small beside the climb, short enough to be of one kind."""

STILL_M_S, STILL_RISE_M_S = 1.0, 0.3
"""Horizontal and vertical speed below which the vehicle hovers."""

UP_M, RUNNING = 2.0, 0.05
"""In the air: this far above the lowest place, m, and with at least this part of the median power."""

LEAST = (20.0, 200.0, 20.0)
"""Least vertical metres, horizontal metres and seconds of hovering for a coefficient."""

LEAST_STEPS = 4
"""Least number of steps that contribute to a coefficient."""

UNIQUE = 0.03
"""Least part of a column's square that the other columns must leave unexplained."""

WIDEST = 0.25
"""Largest half of the 95 % interval, as a part of the value."""

FASTEST_M_S = 150.0
"""A higher speed is a damaged reading."""

HUBER, ROUNDS = 1.345, 30
GAP_S = 3.0
"""Longest pause of positions or battery readings within a step that is used, s."""

NAMES = ("vertical_j_per_m", "horizontal_j_per_m", "hover_w")
WORDS = ("vertical metres", "horizontal metres", "hovering")
AMOUNTS = ("m up and down", "m along", "s of hovering")


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One number of the model, ± ``half_95``. ``value`` None: the log does not determine it; ``why`` is the reason."""

    name: str
    value: float | None
    half_95: float | None
    why: str


@dataclass(frozen=True, slots=True)
class EnergyFit:
    """The fit to one or more logs. ``off_percent`` is the median error of the model in a step's energy."""

    vertical: Coefficient
    horizontal: Coefficient
    hover: Coefficient
    steps: int
    energy_j: float
    speed_m_s: float
    off_percent: float
    notes: tuple[str, ...]

    @property
    def told(self) -> bool:
        """Whether R1 and R2 are both known (hover_w is useful, but a mission can be planned without it)."""
        return self.vertical.value is not None and self.horizontal.value is not None

    def yaml(self) -> str:
        """The lines to paste into a vehicle of a mission file."""
        lines = ["energy:"]
        for c in (self.vertical, self.horizontal, self.hover):
            if c.value is None:
                lines.append(f"  # {c.name}: {c.why}")
            else:
                lines.append(f"  {c.name}: {_three(c.value)}  # ± {_three(c.half_95 or 0.0)} (95 %)")
        return "\n".join(lines) + "\n"

    def as_dict(self) -> dict[str, Any]:
        """The fit as plain values."""
        return {
            c.name: {"value": c.value, "half_95": c.half_95, "why": c.why or None}
            for c in (self.vertical, self.horizontal, self.hover)
        } | {
            "steps": self.steps, "energy_j": self.energy_j, "speed_m_s": self.speed_m_s,
            "off_percent": self.off_percent, "told": self.told, "notes": list(self.notes),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps: ``design`` (N, 3) vertical metres, horizontal metres, hover seconds; ``energy_j``; signed ``rise_m``."""

    design: Floats
    energy_j: Floats
    rise_m: Floats


def fit_energy(logs: Sequence[FlightLog]) -> EnergyFit:
    """The model that fits all ``logs`` together. Raises InputError if they hold no flight."""
    parts = [steps_of(log) for log in logs]
    x = np.concatenate([p.design for p in parts])
    y = np.concatenate([p.energy_j for p in parts])
    if len(y) < 6:
        raise InputError(
            f"hold {len(y) * STEP_S:.0f} s of flight with battery readings, too little for a fit",
            where=", ".join(log.name for log in logs),
        )
    rise = np.concatenate([p.rise_m for p in parts])
    amount = x.sum(axis=0)
    amount[0] = x[np.abs(rise) > STILL_RISE_M_S * STEP_S, 0].sum()  # smaller changes may be height noise
    taking_part = [np.abs(rise) > STILL_RISE_M_S * STEP_S, x[:, 1] > 0.0, x[:, 2] > 0.0]
    parts_of = np.array([t.sum() for t in taking_part])
    has = (amount >= np.array(LEAST)) & (parts_of >= LEAST_STEPS)
    columns = [k for k in range(3) if has[k]]
    kept = x[:, columns].sum(axis=1) > 0.0
    x, y, rise = x[kept], y[kept], rise[kept]
    notes = [n for log in logs for n in log.notes]
    reasons = ["", "", ""]
    for k in range(3):
        if not has[k]:
            reasons[k] = (
                f"{amount[k]:.0f} {AMOUNTS[k]} are too few: at least {LEAST[k]:.0f} are needed"
                if amount[k] < LEAST[k]
                else f"{parts_of[k] * STEP_S:.0f} s of it are too little: {LEAST_STEPS * STEP_S:.0f} s are needed"
            )
    if not columns or len(y) < 2 * len(columns):
        raise InputError(
            "hold no flight: " + "; ".join(r for r in reasons if r), where=", ".join(log.name for log in logs)
        )
    beta, weight = _robust(x[:, columns], y)
    unique = _unique(x[:, columns] * np.sqrt(weight)[:, None])
    half = 1.96 * np.sqrt(np.maximum(np.diag(_covariance(x[:, columns], y, beta, weight)), 0.0))
    made: list[Coefficient] = []
    for k in range(3):
        if reasons[k]:
            made.append(Coefficient(NAMES[k], None, None, reasons[k]))
            continue
        j = columns.index(k)
        why = ""
        if unique[j] < UNIQUE:
            why = _shadow(k, columns, x)
        elif beta[j] <= 0.0:
            why = f"the energy does not grow with {WORDS[k]} in this log"
        elif half[j] > WIDEST * beta[j]:
            about = f"{_three(float(beta[j]))} ± {_three(float(half[j]))}"
            why = f"{about} is too uncertain: fly more of it, or in calmer air"
        made.append(
            Coefficient(NAMES[k], None, None, why) if why else Coefficient(NAMES[k], float(beta[j]), float(half[j]), "")
        )
    said = x[:, columns] @ beta
    moving = x[:, 1] > STILL_M_S * STEP_S
    notes += _up_and_down(x, y, rise, made)
    return EnergyFit(
        vertical=made[0],
        horizontal=made[1],
        hover=made[2],
        steps=len(y),
        energy_j=float(y.sum()),
        speed_m_s=float(np.median(x[moving, 1]) / STEP_S) if moving.any() else 0.0,
        off_percent=float(100.0 * np.median(np.abs(y - said) / np.maximum(y, 1e-9))),
        notes=tuple(notes),
    )


def steps_of(log: FlightLog) -> Steps:
    """The log in steps of `STEP_S`, in the air, without pauses."""
    begin = max(log.place_s[0], log.power_s[0])
    end = min(log.place_s[-1], log.power_s[-1])
    if end - begin < 2.0 * STEP_S:
        raise InputError("positions and battery readings do not overlap in time", where=log.name)
    second = np.arange(begin, end, 1.0)
    east, north, amsl = (_smoothed(log.place_s, a, second) for a in (log.east_m, log.north_m, log.amsl_m))
    spent = _energy_until(log.power_s, log.power_w, second)
    per = int(STEP_S)
    n = (len(second) - 1) // per
    at = np.arange(n + 1) * per
    run = np.hypot(np.diff(east), np.diff(north))[: n * per].reshape(n, per)
    rise = np.diff(amsl)[: n * per].reshape(n, per)
    along, up = run.sum(axis=1), rise.sum(axis=1)
    energy = np.diff(spent[at])
    chord = np.hypot(np.diff(east[at]), np.diff(north[at]))
    slow = (run.max(axis=1) < STILL_M_S) & (chord < STILL_M_S * STEP_S)
    level = np.abs(up) < STILL_RISE_M_S * STEP_S
    still = slow & level
    watts = energy / STEP_S
    flying = (amsl[at[:-1]] > amsl.min() + UP_M) & (amsl[at[1:]] > amsl.min() + UP_M)
    flying &= watts > RUNNING * np.median(watts[flying]) if flying.any() else flying
    whole = ~_paused(log.place_s, second[at]) & ~_paused(log.power_s, second[at])
    # A step that turns from climb to descent, or begins or ends in a hover, is of two kinds and is left out.
    one_kind = np.abs(up) > 0.8 * np.abs(rise).sum(axis=1) - STILL_RISE_M_S * STEP_S
    one_kind &= slow | (run.min(axis=1) >= STILL_M_S) | (along == 0.0)
    columns = np.where(still, 0.0, np.abs(up)), np.where(slow, 0.0, along), np.where(still, STEP_S, 0.0)
    design = np.stack(columns, axis=-1)
    good = flying & whole & one_kind & (energy > 0.0) & (along + np.abs(up) < FASTEST_M_S * STEP_S)
    return Steps(design[good], energy[good], up[good])


def _smoothed(t: Floats, a: Floats, at: Floats) -> Floats:
    """The mean over a second around each of ``at`` if it has several readings; otherwise interpolated."""
    total = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))])

    def until(x: Floats) -> Floats:
        x = np.clip(x, t[0], t[-1])
        k = np.clip(np.searchsorted(t, x, "right") - 1, 0, len(t) - 2)
        value = np.interp(x, t, a)
        return np.asarray(total[k] + 0.5 * (a[k] + value) * (x - t[k]))

    low, high = np.clip(at - 0.5, t[0], t[-1]), np.clip(at + 0.5, t[0], t[-1])
    return np.asarray((until(high) - until(low)) / np.maximum(high - low, 1e-9))


def _energy_until(t: Floats, watts: Floats, at: Floats) -> Floats:
    """Joules from the first reading up to each of ``at``, with power linear between readings."""
    total = np.concatenate([[0.0], np.cumsum(0.5 * (watts[1:] + watts[:-1]) * np.diff(t))])
    k = np.clip(np.searchsorted(t, at, "right") - 1, 0, len(t) - 2)
    return np.asarray(total[k] + 0.5 * (watts[k] + np.interp(at, t, watts)) * (at - t[k]))


def _paused(t: Floats, at: Floats) -> Bools:
    """(N,) whether a pause of the readings reaches into each step between neighbours of ``at``."""
    long = np.flatnonzero(np.diff(t) > GAP_S)
    out = np.zeros(len(at) - 1, np.bool_)
    for k in long.tolist():
        out |= (at[1:] > t[k]) & (at[:-1] < t[k + 1])
    return out


def _robust(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Coefficients >= 0 and final weights: Huber's, on residuals relative to the model's prediction."""
    from scipy.optimize import nnls

    scale = np.maximum(y, 0.2 * np.median(y))
    weight = 1.0 / scale**2
    beta = np.zeros(x.shape[1])
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        before = beta
        beta, _ = nnls(x * root[:, None], y * root)
        said = np.maximum(x @ beta, 0.2 * np.median(y))
        off = (y - x @ beta) / said
        spread = max(1.4826 * float(np.median(np.abs(off))), 1e-6)
        weight = np.minimum(1.0, HUBER * spread / np.maximum(np.abs(off), 1e-12)) / said**2
        if np.allclose(beta, before, rtol=1e-9, atol=1e-12):
            break
    return beta, weight


def _covariance(x: Floats, y: Floats, beta: Floats, weight: Floats) -> Floats:
    """Covariance of the coefficients, from the residuals themselves (White's sandwich)."""
    bread = np.linalg.pinv(x.T @ (weight[:, None] * x))
    inner = x * (weight * (y - x @ beta))[:, None]
    return np.asarray(bread @ (inner.T @ inner) @ bread * (len(y) / max(len(y) - x.shape[1], 1)))


def _unique(x: Floats) -> Floats:
    """(K,) part of each column's square that the other columns do not explain."""
    out = np.ones(x.shape[1])
    for k in range(x.shape[1]):
        others = np.delete(x, k, axis=1)
        if others.shape[1]:
            fitted, *_ = np.linalg.lstsq(others, x[:, k], rcond=None)
            left = x[:, k] - others @ fitted
            out[k] = float(left @ left) / max(float(x[:, k] @ x[:, k]), 1e-300)
    return out


def _shadow(k: int, columns: Sequence[int], x: Floats) -> str:
    others = " and ".join(WORDS[c] for c in columns if c != k and (x[:, c] > 0.0).any())
    if k < 2:
        return (
            f"cannot be told apart from {others}: the log has them always in the same proportion; fly some of it "
            f"level and some of it up and down"
        )
    return f"cannot be told apart from {others}"


def _up_and_down(x: Floats, y: Floats, rise: Floats, made: Sequence[Coefficient]) -> list[str]:
    """A note on the separate costs of a metre up and a metre down, for which the model has one number."""
    if made[0].value is None or made[1].value is None:
        return []
    up, down = np.where(rise > 0.0, x[:, 0], 0.0), np.where(rise < 0.0, x[:, 0], 0.0)
    rest = y - x[:, 1] * made[1].value - x[:, 2] * (made[2].value or 0.0)
    if up.sum() < LEAST[0] or down.sum() < LEAST[0]:
        flown = "climbs" if up.sum() >= down.sum() else "descents"
        return [f"the vertical metres are nearly all {flown}: R1 is theirs alone"]
    each = [float(side @ rest / (side @ side)) for side in (up, down)]
    if abs(each[0] - each[1]) > 0.3 * made[0].value:
        return [
            f"a metre up costs about {each[0]:.0f} J and a metre down {each[1]:.0f} J; R1 is one number for both, good "
            f"for missions that climb as much as they descend"
        ]
    return []


def _three(value: float) -> str:
    """Three significant digits, without an exponent."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(2 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{digits}f}"
