"""Way points that are flown by, not over: their turns, and the legs and arcs of one radius between them."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats

__all__ = ["flown_m", "tangents_m", "thinned", "turns_of"]


NEAREST_M, SLIGHT_M = 3.0, 0.5
"""Metres: of two way points nearer to each other than `NEAREST_M`, one with a tangent under `SLIGHT_M` is dropped."""


def turns_of(points: Floats) -> Floats:
    """(N - 2,) turn at each inner point, radians, left positive; 0 beside a leg without horizontal length."""
    way = np.diff(points[:, :2], axis=0)
    heading = np.arctan2(way[:, 1], way[:, 0])
    turn = (np.diff(heading) + math.pi) % (2.0 * math.pi) - math.pi
    moves = np.hypot(*way.T) > 1e-6
    return np.asarray(np.where(moves[:-1] & moves[1:], turn, 0.0))


def tangents_m(points: Floats, radius_m: float) -> Floats:
    """(N,) tangent length at each point, metres: its arc reaches that far before and behind it; 0 at both ends."""
    inner = radius_m * np.tan(0.5 * np.minimum(np.abs(turns_of(points)), math.pi - 1e-6))
    return np.concatenate([[0.0], inner, [0.0]])


def flown_m(points: Floats, radius_m: float) -> Floats:
    """(N - 1,) horizontal metres flown from the middle of each point's arc to the middle of the next one's."""
    tangent = tangents_m(points, radius_m)
    half = np.concatenate([[0.0], 0.5 * radius_m * np.abs(turns_of(points)), [0.0]])
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    return np.asarray(half[:-1] + np.abs(run - tangent[:-1] - tangent[1:]) + half[1:])


def thinned(points: Floats, radius_m: float) -> Floats:
    """Return ``points`` without slight turns that lie so near to a neighbour that both arcs do not fit; ends stay."""
    while len(points) > 2:
        tangent = tangents_m(points, radius_m)
        run = np.hypot(*np.diff(points[:, :2], axis=0).T)
        for k in np.flatnonzero(run < np.maximum(tangent[:-1] + tangent[1:] - 0.01, NEAREST_M)).tolist():
            inner = [i for i in (k, k + 1) if 0 < i < len(points) - 1 and tangent[i] < SLIGHT_M]
            if inner:
                points = np.delete(points, min(inner, key=lambda i: float(tangent[i])), axis=0)
                break
        else:
            break
    return points
