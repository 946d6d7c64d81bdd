"""Fit the energy model to flown energy: a vertical metre, a metre through the air, a second of flight, one of hovering.

The model is that of `gcsplan.vehicle.Energy`, with which missions are planned: a step of the flight takes R1 times its
vertical metres plus R2 times its horizontal metres through the air plus the base power times its seconds, or hover
power times its seconds of hovering. Flights at one speed cannot tell the base power from R2: it is then left out, and
the fit holds at that speed. Metres are through the air where the log tells the wind. The fit is weighted
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

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog, require_power
from gcsplan.logs.steps import STEP_S, STILL_M_S, STILL_RISE_M_S, steps_of

LEAST = (20.0, 200.0, 20.0)
"""Least vertical metres, horizontal metres and seconds of hovering for a coefficient."""

LEAST_STEPS = 4
"""Least number of steps that contribute to a coefficient."""

UNIQUE = 0.03
"""Least part of a column's square that the other columns must leave unexplained."""

WIDEST = 0.25
"""Largest half of the 95 % interval, as a part of the value."""

HUBER, ROUNDS = 1.345, 30
NAMES = ("vertical_j_per_m", "horizontal_j_per_m", "hover_w", "base_w")
WORDS = ("vertical metres", "horizontal metres", "hovering", "time")
BASE = 3
"""The column of the seconds that are not hovering."""

APART = 1.2
"""The fastest airspeed over the slowest that tells a base power."""

ALIKE = 0.1
"""Beside a base power: the part of the power to which what a metre adds must be known; it may be nothing."""

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
    notes: tuple[str, ...]

    @property
    def told(self) -> bool:
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
            "off_percent": self.off_percent, "told": self.told, "notes": list(self.notes),
        }  # fmt: skip


def fit_energy(logs: Iterable[FlightLog]) -> EnergyFit:
    """The model that fits all ``logs`` together, of which one is held at a time. Raises InputError if they hold no
    flight."""
    parts, names, winds = [], [], []
    log_notes: list[str] = []
    for log in logs:
        parts.append(steps_of(log))
        names.append(log.name)
        log_notes += log.notes
        winds.append(float(np.hypot(log.wind[:, 1], log.wind[:, 2]).mean()) if len(log.wind) else None)
    where = ", ".join(names)
    x = np.concatenate([p.design for p in parts])
    y = np.concatenate([p.energy_j for p in parts])
    rise = np.concatenate([p.rise_m for p in parts])
    if len(y) < 6:
        raise InputError(
            f"hold {len(y) * STEP_S:.0f} s of flight with battery readings, too little for a fit", where=where
        )
    require_power(y / STEP_S, where)
    reasons = _too_little(x, rise)
    columns = [k for k in range(3) if not reasons[k]]
    kept = x[:, columns].sum(axis=1) > 0.0
    x, y, rise = x[kept], y[kept], rise[kept]
    if not columns or len(y) < 2 * len(columns):
        raise InputError("hold no flight: " + "; ".join(r for r in reasons if r), where=where)
    moving = x[:, 1] > STILL_M_S * STEP_S
    speeds = x[moving, 1] / STEP_S if moving.any() else np.zeros(1)
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
        off_percent=float(100.0 * np.median(np.abs(y - (based or alone).said) / np.maximum(y, 1e-9))),
        notes=(*log_notes, *_of_wind(winds), *_up_and_down(x, y, rise, made, base)),
    )


def _too_little(x: Floats, rise: Floats) -> list[str]:
    """Why too little of each motion was flown for its coefficient; empty: it is enough."""
    amount = x[:, :3].sum(axis=0)
    up = np.abs(rise) > STILL_RISE_M_S * STEP_S
    amount[0] = x[up, 0].sum()  # smaller changes may be height noise
    steps = np.array([t.sum() for t in (up, x[:, 1] > 0.0, x[:, 2] > 0.0)])
    reasons = []
    for k in range(3):
        if amount[k] < LEAST[k]:
            reasons.append(f"{amount[k]:.0f} {AMOUNTS[k]} are too few: at least {LEAST[k]:.0f} are needed")
        elif steps[k] < LEAST_STEPS:
            reasons.append(f"{steps[k] * STEP_S:.0f} s of it are too little: {LEAST_STEPS * STEP_S:.0f} s are needed")
        else:
            reasons.append("")
    return reasons


@dataclass(frozen=True, eq=False)
class _Model:
    """Coefficients of some columns, their halves of the 95 % interval, and the energy that they say of each step.

    ``alike_w``: the power of a step up to which a coefficient with a base power beside it need not be known; it may
    then be 0. None without a base.
    """

    x: Floats
    columns: list[int]
    beta: Floats
    half: Floats
    unique: Floats
    said: Floats
    alike_w: float | None = None

    @classmethod
    def of(cls, x: Floats, y: Floats, columns: list[int]) -> _Model:
        some = x[:, columns]
        beta, weight = _robust(some, y)
        half = 1.96 * np.sqrt(np.maximum(np.diag(_covariance(some, y, beta, weight)), 0.0))
        alike = ALIKE * float(np.median(y)) / STEP_S if BASE in columns else None
        return cls(x, columns, beta, half, _unique(some * np.sqrt(weight)[:, None]), some @ beta, alike)

    def coefficients(self, reasons: Sequence[str]) -> list[Coefficient]:
        """R1, R2 and hover power; ``reasons``: why one of them has no column."""
        return [self._one(k) if not reasons[k] else Coefficient(NAMES[k], None, None, reasons[k]) for k in range(3)]

    @property
    def base(self) -> Coefficient:
        """The base power."""
        return self._one(BASE)

    def _one(self, k: int) -> Coefficient:
        j = self.columns.index(k)
        value, half, why = float(self.beta[j]), float(self.half[j]), ""
        per_s = np.median(self.x[self.x[:, k] > 0.0, k]) / STEP_S
        alike = self.alike_w is not None and k < 2 and half * per_s <= self.alike_w
        if self.unique[j] < UNIQUE:
            why = _shadow(k, self.columns, self.x)
        elif value <= 0.0 and not alike:
            why = f"the energy does not grow with {WORDS[k]} in this log"
        elif half > WIDEST * value and not alike:
            about = f"{_three(value)} ± {_three(half)}"
            why = f"{about} is too uncertain: fly more of it, or in calmer air"
        return Coefficient(NAMES[k], None, None, why) if why else Coefficient(NAMES[k], value, half, "")


def _with_base(
    x: Floats, y: Floats, columns: Sequence[int], speeds_m_s: tuple[float, float]
) -> tuple[_Model | None, str]:
    """The model with a base power, or why the flights do not tell one."""
    slow, fast = speeds_m_s
    if fast < APART * slow:
        return None, f"flown at {_three(0.5 * (slow + fast))} m/s through the air alone: fly at two speeds or more"
    model = _Model.of(x, y, [*columns, BASE])
    if model.base.value is None:
        return None, model.base.why
    return model, ""


def _of_wind(winds_m_s: Sequence[float | None]) -> list[str]:
    """Whether metres are those through the air; ``winds_m_s``: the mean wind of each log, None if it tells none."""
    told = [wind for wind in winds_m_s if wind is not None]
    if not told:
        return ["no log tells the wind: metres over ground are taken for those through the air"]
    words = f"metres are those through the air, in a wind of {max(told):.1f} m/s as the log tells it"
    none, every = len(winds_m_s) - len(told), len(winds_m_s)
    return [f"{words}; {none} of {every} logs tell none" if none else words]


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
    if k == BASE:
        return f"cannot be told apart from {others}: the log has them always in the same proportion; fly at two speeds"
    if k < 2:
        return (
            f"cannot be told apart from {others}: the log has them always in the same proportion; fly some of it "
            f"level and some of it up and down"
        )
    return f"cannot be told apart from {others}"


def _up_and_down(x: Floats, y: Floats, rise: Floats, made: Sequence[Coefficient], base: Coefficient) -> list[str]:
    """A note on the separate costs of a metre up and a metre down, for which the model has one number."""
    if made[0].value is None or made[1].value is None:
        return []
    up, down = np.where(rise > 0.0, x[:, 0], 0.0), np.where(rise < 0.0, x[:, 0], 0.0)
    rest = y - x[:, 1] * made[1].value - x[:, 2] * (made[2].value or 0.0) - x[:, BASE] * (base.value or 0.0)
    if up.sum() < LEAST[0] or down.sum() < LEAST[0]:
        flown = "climbs" if up.sum() >= down.sum() else "descents"
        return [f"the vertical metres are nearly all {flown}: R1 is theirs alone"]
    each = [float(side @ rest / (side @ side)) for side in (up, down)]
    if abs(each[0] - each[1]) > 0.3 * max(made[0].value, 1.0):
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
