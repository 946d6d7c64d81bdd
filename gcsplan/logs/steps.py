"""A flight log in steps of a few seconds: what each moved, how long, and what it took."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog

__all__ = ["STEP_S", "STILL_M_S", "STILL_RISE_M_S", "Steps", "steps_of"]

STEP_S = 5.0
"""Length of a step: long enough that height noise is small beside the climb, short enough to be of one kind."""

STILL_M_S, STILL_RISE_M_S = 1.0, 0.3
"""Horizontal and vertical speed below which the vehicle hovers."""

UP_M, RUNNING = 2.0, 0.05
"""In the air: this far above the lowest place, m, and with at least this part of the median power."""

FASTEST_M_S = 150.0
"""A higher speed is a damaged reading."""

GAP_S = 3.0
"""Longest pause of positions or battery readings within a step that is used, s."""


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps: ``design`` (N, 4) vertical metres, horizontal metres through the air, seconds of hovering and of moving;
    ``energy_j``; signed ``rise_m``."""

    design: Floats
    energy_j: Floats
    rise_m: Floats


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
    over_ground = along
    if len(log.wind):
        blown = np.stack([np.interp(second, log.wind[:, 0], log.wind[:, k]) for k in (1, 2)], axis=-1)
        blown = 0.5 * (blown[1:] + blown[:-1])  # metres in each second
        through = np.hypot(np.diff(east) - blown[:, 0], np.diff(north) - blown[:, 1])
        along = through[: n * per].reshape(n, per).sum(axis=1)
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
    one_kind &= slow | (run.min(axis=1) >= STILL_M_S) | (over_ground == 0.0)
    # A climb on the spot counts no metres along: in a wind its power is taken with its climb.
    columns = (
        np.where(still, 0.0, np.abs(up)), np.where(slow, 0.0, along), np.where(still, STEP_S, 0.0),
        np.where(still, 0.0, STEP_S),
    )  # fmt: skip
    design = np.stack(columns, axis=-1)
    good = flying & whole & one_kind & (energy > 0.0) & (over_ground + np.abs(up) < FASTEST_M_S * STEP_S)
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
