"""Fit the energy model to flown energy: a vertical metre, a metre through the air, a second of flight, one of hovering.

The model is `gcsplan.vehicle.Energy`, with which missions are planned: a step of the flight takes R1 times its
vertical metres plus R2 times its horizontal metres through the air plus the base power times its seconds, or hover
power times its seconds of hovering. Flights at one speed cannot separate the base power from R2: it is then left out,
and the fit holds at that speed. Metres are through the air where the log has the wind. The fit is weighted
least squares over steps of a few seconds, robust by Huber's weights, with no coefficient below 0. A coefficient is
reported only if the log determines it: enough of its motion was flown, the other columns do not explain its column, and
its 95 % interval is narrow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog, require_power
from gcsplan.notes.note import Note, in_json

LOG_STEP_S = 5.0
"""Length of a step: long enough that height noise is small beside the climb, short enough to be of one kind."""

HOVERS_BELOW_M_S, HOVER_RISE_M_S = 1.0, 0.3
"""Horizontal and vertical speed below which the vehicle hovers."""

UP_M, RUNNING = 2.0, 0.05
"""In the air: this far above the lowest place, m, and with at least this part of the median power."""

FASTEST_READING_M_S = 150.0
"""A higher speed is a damaged reading."""

GAP_S = 3.0
"""Longest pause of positions or battery readings within a step that is used, s."""

LEAST_MOTION = (20.0, 200.0, 20.0)
"""Least vertical metres, horizontal metres and seconds of hovering for a coefficient."""

LEAST_STEPS = 4
"""Least number of steps that contribute to a coefficient."""

UNIQUE = 0.03
"""Least part of a column's square that the other columns must leave unexplained."""

WIDEST_HALF_95 = 0.25
"""Largest half of the 95 % interval, as a part of the value."""

HUBER, HUBER_ROUNDS = 1.345, 30
MODEL_NAMES = ("vertical_j_per_m", "horizontal_j_per_m", "hover_w", "base_w")
MOTIONS = ("vertical metres", "horizontal metres", "hovering", "time")
BASE = 3
"""The column of the seconds that are not hovering."""

LEAST_SPEED_RATIO = 1.2
"""Least ratio of the fastest to the slowest airspeed that determines a base power."""

ALIKE_POWER = 0.1
"""Beside a base power: the part of the power to which a metre's own share must be known; the share may be 0."""

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
    """The fit to one or more logs. ``off_percent`` is the median error of the model in a step's energy.

    ``fitted_m_s``: slowest and fastest airspeed at which it holds, one number twice without a base power.
    """

    vertical: Coefficient
    horizontal: Coefficient
    hover: Coefficient
    base: Coefficient
    fitted_m_s: tuple[float, float]
    steps: int
    energy_j: float
    speed_m_s: float
    off_percent: float
    notes: tuple[Note, ...]

    @property
    def is_complete(self) -> bool:
        """Whether R1 and R2 are both known (hover_w is useful, but a mission can be planned without it)."""
        return self.vertical.value is not None and self.horizontal.value is not None

    def yaml(self) -> str:
        """The lines to paste into a vehicle of a mission file."""
        lines = ["energy:"]
        for c in (self.vertical, self.horizontal, self.base, self.hover):
            if c.value is None:
                lines.append(f"  # {c.name}: {c.why}")
            else:
                lines.append(f"  {c.name}: {_three(c.value)}  # ± {_three(c.half_95 or 0.0)} (95 %)")
        slow, fast = (_three(v) for v in self.fitted_m_s)
        if self.speed_m_s > 0.0:
            lines.append(f"  fitted_speed_m_s: {slow if slow == fast else f'[{slow}, {fast}]'}")
        return "\n".join(lines) + "\n"

    def as_dict(self) -> dict[str, Any]:
        """The fit as plain values."""
        return {
            c.name: {"value": c.value, "half_95": c.half_95, "why": c.why or None}
            for c in (self.vertical, self.horizontal, self.base, self.hover)
        } | {
            "steps": self.steps, "energy_j": self.energy_j, "speed_m_s": self.speed_m_s,
            "fitted_speed_m_s": list(self.fitted_m_s),
            "off_percent": self.off_percent, "told": self.is_complete, **in_json("notes", self.notes),
        }  # fmt: skip


def fit_energy(logs: Iterable[FlightLog]) -> EnergyFit:
    """The model that fits all ``logs`` together, of which one is held at a time. Raises InputError if they hold no
    flight."""
    parts, names, winds = [], [], []
    log_notes: list[Note] = []
    for log in logs:
        parts.append(_steps_of(log))
        names.append(log.name)
        log_notes += log.notes
        winds.append(float(np.hypot(log.wind[:, 1], log.wind[:, 2]).mean()) if len(log.wind) else None)
    where = ", ".join(names)
    x = np.concatenate([p.design for p in parts])
    y = np.concatenate([p.energy_j for p in parts])
    rise = np.concatenate([p.rise_m for p in parts])
    if len(y) < 6:
        raise InputError(
            f"hold {len(y) * LOG_STEP_S:.0f} s of flight with battery readings, too little for a fit", where=where
        )
    require_power(y / LOG_STEP_S, where)
    reasons = _too_little(x, rise)
    columns = [k for k in range(3) if not reasons[k]]
    kept = x[:, columns].sum(axis=1) > 0.0
    x, y, rise = x[kept], y[kept], rise[kept]
    if not columns or len(y) < 2 * len(columns):
        raise InputError("hold no flight: " + "; ".join(r for r in reasons if r), where=where)
    moving = x[:, 1] > HOVERS_BELOW_M_S * LOG_STEP_S
    speeds = x[moving, 1] / LOG_STEP_S if moving.any() else np.zeros(1)
    slow, middle, fast = (float(v) for v in np.quantile(speeds, (0.05, 0.5, 0.95)))
    based, why = _with_base(x, y, columns, (slow, fast)) if 1 in columns else (None, "nothing was flown along")
    if based is not None:
        made, base, columns = based.coefficients(reasons), based.base, [*columns, BASE]
        fitted = slow, fast
    else:
        alone = _Model.of(x, y, columns)
        made, base = alone.coefficients(reasons), Coefficient("base_w", None, None, why)
        fitted = middle, middle
    return EnergyFit(
        vertical=made[0],
        horizontal=made[1],
        hover=made[2],
        base=base,
        fitted_m_s=fitted,
        steps=len(y),
        energy_j=float(y.sum()),
        speed_m_s=middle if moving.any() else 0.0,
        off_percent=float(100.0 * np.median(np.abs(y - (based or alone).predicted) / np.maximum(y, 1e-9))),
        notes=(*log_notes, *_of_wind(winds), *_up_and_down(x, y, rise, made, base)),
    )


def _too_little(x: Floats, rise: Floats) -> list[str]:
    """Why too little of each motion was flown for its coefficient; empty: it is enough."""
    amount = x[:, :3].sum(axis=0)
    up = np.abs(rise) > HOVER_RISE_M_S * LOG_STEP_S
    amount[0] = x[up, 0].sum()  # smaller changes may be height noise
    steps = np.array([t.sum() for t in (up, x[:, 1] > 0.0, x[:, 2] > 0.0)])
    reasons = []
    for k in range(3):
        if amount[k] < LEAST_MOTION[k]:
            reasons.append(f"{amount[k]:.0f} {AMOUNTS[k]} are too few: at least {LEAST_MOTION[k]:.0f} are needed")
        elif steps[k] < LEAST_STEPS:
            reasons.append(
                f"{steps[k] * LOG_STEP_S:.0f} s of it are too little: {LEAST_STEPS * LOG_STEP_S:.0f} s are needed"
            )
        else:
            reasons.append("")
    return reasons


@dataclass(frozen=True, eq=False)
class _Model:
    """Coefficients of some columns, their halves of the 95 % interval, and the energy that they predict for each step.

    ``alike_w``: the power of a step up to which a coefficient with a base power beside it need not be known; it may
    then be 0. None without a base.
    """

    x: Floats
    columns: list[int]
    beta: Floats
    half: Floats
    unique: Floats
    predicted: Floats
    alike_w: float | None = None

    @classmethod
    def of(cls, x: Floats, y: Floats, columns: list[int]) -> _Model:
        some = x[:, columns]
        beta, weight = _robust(some, y)
        half = 1.96 * np.sqrt(np.maximum(np.diag(_covariance(some, y, beta, weight)), 0.0))
        alike = ALIKE_POWER * float(np.median(y)) / LOG_STEP_S if BASE in columns else None
        return cls(x, columns, beta, half, _unique(some * np.sqrt(weight)[:, None]), some @ beta, alike)

    def coefficients(self, reasons: Sequence[str]) -> list[Coefficient]:
        """R1, R2 and hover power; ``reasons``: why one of them has no column."""
        return [
            self._one(k) if not reasons[k] else Coefficient(MODEL_NAMES[k], None, None, reasons[k]) for k in range(3)
        ]

    @property
    def base(self) -> Coefficient:
        """The base power."""
        return self._one(BASE)

    def _one(self, k: int) -> Coefficient:
        j = self.columns.index(k)
        value, half, why = float(self.beta[j]), float(self.half[j]), ""
        per_s = np.median(self.x[self.x[:, k] > 0.0, k]) / LOG_STEP_S
        alike = self.alike_w is not None and k < 2 and half * per_s <= self.alike_w
        if self.unique[j] < UNIQUE:
            why = _shadow(k, self.columns, self.x)
        elif value <= 0.0 and not alike:
            why = f"the energy does not grow with {MOTIONS[k]} in this log"
        elif half > WIDEST_HALF_95 * value and not alike:
            about = f"{_three(value)} ± {_three(half)}"
            why = f"{about} is too uncertain: fly more of it, or in calmer air"
        return Coefficient(MODEL_NAMES[k], None, None, why) if why else Coefficient(MODEL_NAMES[k], value, half, "")


def _with_base(
    x: Floats, y: Floats, columns: Sequence[int], speeds_m_s: tuple[float, float]
) -> tuple[_Model | None, str]:
    """The model with a base power, or why the flights do not determine one."""
    slow, fast = speeds_m_s
    if fast < LEAST_SPEED_RATIO * slow:
        return None, f"flown at {_three(0.5 * (slow + fast))} m/s through the air alone: fly at two speeds or more"
    model = _Model.of(x, y, [*columns, BASE])
    if model.base.value is None:
        return None, model.base.why
    return model, ""


def _of_wind(winds_m_s: Sequence[float | None]) -> list[Note]:
    """Whether metres are through the air; ``winds_m_s``: the mean wind of each log, None if it has none."""
    known = [wind for wind in winds_m_s if wind is not None]
    if not known:
        return [Note("wind_unknown")]
    silent, logs = len(winds_m_s) - len(known), len(winds_m_s)
    return [Note("wind_counted_of_some" if silent else "wind_counted", wind_m_s=max(known), silent=silent, logs=logs)]


def _robust(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Coefficients >= 0 and final weights: Huber's, on residuals relative to the model's prediction."""
    from scipy.optimize import nnls

    scale = np.maximum(y, 0.2 * np.median(y))
    weight = 1.0 / scale**2
    beta = np.zeros(x.shape[1])
    for _ in range(HUBER_ROUNDS):
        root = np.sqrt(weight)
        before = beta
        beta, _ = nnls(x * root[:, None], y * root)
        predicted = np.maximum(x @ beta, 0.2 * np.median(y))
        off = (y - x @ beta) / predicted
        spread = max(1.4826 * float(np.median(np.abs(off))), 1e-6)
        weight = np.minimum(1.0, HUBER * spread / np.maximum(np.abs(off), 1e-12)) / predicted**2
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
    others = " and ".join(MOTIONS[c] for c in columns if c != k and (x[:, c] > 0.0).any())
    if k == BASE:
        return f"cannot be separated from {others}: the log has them always in the same proportion; fly at two speeds"
    if k < 2:
        return (
            f"cannot be separated from {others}: the log has them always in the same proportion; fly some of it "
            f"level and some of it up and down"
        )
    return f"cannot be separated from {others}"


def _up_and_down(x: Floats, y: Floats, rise: Floats, made: Sequence[Coefficient], base: Coefficient) -> list[Note]:
    """A note on the separate costs of a metre up and a metre down, for which the model has one number."""
    if made[0].value is None or made[1].value is None:
        return []
    up, down = np.where(rise > 0.0, x[:, 0], 0.0), np.where(rise < 0.0, x[:, 0], 0.0)
    rest = y - x[:, 1] * made[1].value - x[:, 2] * (made[2].value or 0.0) - x[:, BASE] * (base.value or 0.0)
    if up.sum() < LEAST_MOTION[0] or down.sum() < LEAST_MOTION[0]:
        return [Note("nearly_all_climbs" if up.sum() >= down.sum() else "nearly_all_descents")]
    each = [float(side @ rest / (side @ side)) for side in (up, down)]
    if abs(each[0] - each[1]) > 0.3 * max(made[0].value, 1.0):
        return [Note("up_and_down_differ", up_j_per_m=each[0], down_j_per_m=each[1])]
    return []


def _three(value: float) -> str:
    """Three significant digits, without an exponent."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(2 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{digits}f}"


# -- a flight in steps of a few seconds: metres, seconds and joules of each ------------------------------------------


@dataclass(frozen=True, eq=False)
class FlightSteps:
    """N steps: ``design`` (N, 4) vertical metres, horizontal metres through the air, seconds of hovering and of moving;
    ``energy_j``; signed ``rise_m``."""

    design: Floats
    energy_j: Floats
    rise_m: Floats


def _steps_of(log: FlightLog) -> FlightSteps:
    """The log in steps of `LOG_STEP_S`, in the air, without pauses."""
    begin = max(log.place_s[0], log.power_s[0])
    end = min(log.place_s[-1], log.power_s[-1])
    if end - begin < 2.0 * LOG_STEP_S:
        raise InputError("positions and battery readings do not overlap in time", where=log.name)
    second = np.arange(begin, end, 1.0)
    east, north, amsl = (_smoothed(log.place_s, a, second) for a in (log.east_m, log.north_m, log.amsl_m))
    spent = _energy_until(log.power_s, log.power_w, second)
    per = int(LOG_STEP_S)
    n = (len(second) - 1) // per
    at = np.arange(n + 1) * per
    run = np.hypot(np.diff(east), np.diff(north))[: n * per].reshape(n, per)
    rise = np.diff(amsl)[: n * per].reshape(n, per)
    along, up = run.sum(axis=1), rise.sum(axis=1)
    energy = np.diff(spent[at])
    over_ground = along
    if len(log.wind):
        blown = np.stack([np.interp(second, log.wind[:, 0], log.wind[:, k]) for k in (1, 2)], axis=-1)
        blown = 0.5 * (blown[1:] + blown[:-1])  # metres in each second
        through = np.hypot(np.diff(east) - blown[:, 0], np.diff(north) - blown[:, 1])
        along = through[: n * per].reshape(n, per).sum(axis=1)
    chord = np.hypot(np.diff(east[at]), np.diff(north[at]))
    slow = (run.max(axis=1) < HOVERS_BELOW_M_S) & (chord < HOVERS_BELOW_M_S * LOG_STEP_S)
    level = np.abs(up) < HOVER_RISE_M_S * LOG_STEP_S
    still = slow & level
    watts = energy / LOG_STEP_S
    flying = (amsl[at[:-1]] > amsl.min() + UP_M) & (amsl[at[1:]] > amsl.min() + UP_M)
    flying &= watts > RUNNING * np.median(watts[flying]) if flying.any() else flying
    whole = ~_paused(log.place_s, second[at]) & ~_paused(log.power_s, second[at])
    # A step that turns from climb to descent, or begins or ends in a hover, is of two kinds and is left out.
    one_kind = np.abs(up) > 0.8 * np.abs(rise).sum(axis=1) - HOVER_RISE_M_S * LOG_STEP_S
    one_kind &= slow | (run.min(axis=1) >= HOVERS_BELOW_M_S) | (over_ground == 0.0)
    # A climb on the spot counts no metres along: in a wind its power is taken with its climb.
    columns = (
        np.where(still, 0.0, np.abs(up)), np.where(slow, 0.0, along), np.where(still, LOG_STEP_S, 0.0),
        np.where(still, 0.0, LOG_STEP_S),
    )  # fmt: skip
    design = np.stack(columns, axis=-1)
    good = flying & whole & one_kind & (energy > 0.0) & (over_ground + np.abs(up) < FASTEST_READING_M_S * LOG_STEP_S)
    return FlightSteps(design[good], energy[good], up[good])


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
