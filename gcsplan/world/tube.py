"""The tube: floor and ceiling for an altitude profile along a track.

Tubes are cut and joined, so that after a change of the track only the changed part needs a new tube.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.native.signature import Held
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import distances_m
from gcsplan.world.kernels.entries import pieces
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.shared import BAND_HIGH, BAND_LOW, BOW_M, CEILING, CEILING_AGL, FLOOR, FLOOR_AGL
from gcsplan.world.zone_table import ZoneTable

ROOM_M = 0.02
"""Extra reach, m, for the accuracy that the check loses between the plane and the grid."""

FINE_ROOM_M = 0.002
"""The same where the map is exact: twice the smallest pieces that the check cuts beside a cliff."""

ZONE_ROOM_M = 0.05
"""The same beside a zone whose levels follow the ground."""

TUBE_MARGIN_M = 0.01
"""Extra height, m: twice the resolution of the check's branch and bound."""


@dataclass(frozen=True, eq=False)
class Tube:
    """Floor and ceiling for an altitude profile over a track of legs, piece by piece.

    ``s_m`` (M + 1,): breakpoints, horizontal metres along the track. ``floor_m``, ``ceiling_m`` (M, 2): AMSL at both
    ends of each piece, linear between (neighbouring pieces may jump); ``floor_m`` is never below what
    `Airspace.examine` demands, ``ceiling_m`` never above it; inf/-inf where unbounded; floor +inf where the ground is
    unknown. Zones are not included: they are in ``bands``.
    """

    s_m: Floats
    floor_m: Floats
    ceiling_m: Floats
    bands: tuple[Band, ...]


@dataclass(frozen=True, eq=False)
class Band:
    """A span of the track, ``s0_m`` to ``s1_m``, that is horizontally within reach of a zone (a zone may have several).

    A profile must stay at or below ``bottom_m`` or at or above ``top_m``; each (K, 2) over pieces with breakpoints
    ``s_m`` (K + 1,), conservative as in `Tube`; bottom -inf: no flight below the zone; top +inf: no flight above it.
    """

    zone: int
    s0_m: float
    s1_m: float
    s_m: Floats
    bottom_m: Floats
    top_m: Floats


@dataclass(frozen=True, slots=True)
class Reaches:
    """How far from a place the ground counts, metres of the plane: for errors (near), clearance (far); margins added.

    If the map is exact and nothing beside the place counts, there is no margin: the check is exact there too.
    ``near_margin_m``, ``far_margin_m``: extra heights to keep above the ground within the reach. ``zone_m``: the reach
    of zones, without margins.
    """

    near_m: float
    far_m: float
    near_margin_m: float
    far_margin_m: float
    zone_m: float

    @classmethod
    def of(cls, limits: Limits, field: Field, scale: float) -> Reaches:
        """The reaches that ``limits`` demand."""
        near = limits.track_error_m * scale
        far = near + limits.horizontal_clearance_m * scale
        if field.affine:
            rooms = [FINE_ROOM_M if r > 0.0 else 0.0 for r in (near, far)]
        else:
            rooms = [ROOM_M + 2.0 * field.error_m] * 2
        margins = [TUBE_MARGIN_M if room > 0.0 else 0.0 for room in rooms]
        return cls(near + rooms[0], far + rooms[1], margins[0], margins[1], far)


def make_tube(
    track: Floats,
    limits: Limits,
    field: Field,
    zones: ZoneTable,
    extrema: Callable[[bool, float], Held],
    surfaces: Held,
    grounds: Held,
    scale: float,
) -> Tube:
    """The tube over ``track`` (N, 2); ``extrema(of_top, reach_m)`` returns the surface's bounds. See `Tube`.

    ``surfaces``: the map with ground and top; ``grounds``: the map with the ground for both.
    """
    reach = Reaches.of(limits, field, scale)
    bow = 0.0 if field.affine else BOW_M + 2.0 * field.error_m
    under, beside = extrema(False, reach.near_m + bow), extrema(True, reach.near_m + bow)
    beyond = extrema(True, reach.far_m + bow)
    rows = _pieces(surfaces, under, beside, beyond, track, (reach.near_m, reach.near_m, reach.far_m))
    error, margin = limits.altitude_error_m, reach.near_margin_m
    floor = rows[:, 3:5] + (limits.min_agl_m + error + margin)
    if limits.horizontal_clearance_m > 0.0:
        floor = np.maximum(floor, rows[:, 5:7] + (error + reach.far_margin_m))
    unknown = np.isnan(floor)
    ceiling = np.full_like(floor, np.inf)
    if limits.max_agl_m is not None:
        ceiling = np.where(unknown, -np.inf, rows[:, 1:3] + (limits.max_agl_m - error - margin))
    if limits.max_amsl_m is not None:
        ceiling = np.minimum(ceiling, limits.max_amsl_m - error)
    return Tube(
        np.concatenate([[0.0], rows[:, 0]]),
        np.where(unknown, np.inf, floor),
        ceiling,
        _bands(track, limits, field, zones, extrema, reach, grounds),
    )


def _pieces(
    surfaces: Held, under: Held, beside: Held, beyond: Held, track: Floats, reaches: tuple[float, float, float]
) -> Floats:
    room = 2048
    while True:
        rows = np.empty((room, 7))
        count = pieces(surfaces, under, beside, beyond, track, *reaches, rows)
        if count <= room:
            return rows[:count]
        room = count


def _bands(
    track: Floats, limits: Limits, field: Field, zones: ZoneTable,
    extrema: Callable[[bool, float], Held], reach: Reaches, grounds: Held,
) -> tuple[Band, ...]:  # fmt: skip
    """One band for each span of the track within reach of a zone, by zone and distance along the track."""
    error = limits.over_zone_m
    wide = reach.far_m + ZONE_ROOM_M
    length = distances_m(track)
    out: list[Band] = []
    for zone, s0, s1 in zones.spans(track, reach.zone_m, wide):
        numbers = zones.arrays.table[zone]
        bottom, top, agl = numbers[FLOOR], numbers[CEILING], numbers[[FLOOR_AGL, CEILING_AGL]]
        if agl.any():
            around = extrema(False, wide + (0.0 if field.affine else BOW_M + 2.0 * field.error_m))
            part = _between(track, length, s0, s1)
            ground = _pieces(grounds, around, around, around, part, (wide,) * 3)
            if not len(ground):
                continue  # touched at one place, with all of the extra reach between
            s = np.concatenate([[s0], s0 + ground[:, 0]])
            low, high = ground[:, 1:3], ground[:, 3:5]
        else:
            s, low, high = np.array([s0, s1]), np.zeros((1, 2)), np.zeros((1, 2))
        # Bounds over all the ground under the zone hold too; where ground is unknown, the zone can be neither overflown
        # nor underflown.
        if agl[0]:
            low = np.fmax(low + (bottom - TUBE_MARGIN_M), numbers[BAND_LOW])
            low = np.where(np.isnan(ground[:, 1:3]), -np.inf, low)
        else:
            low = np.full_like(low, bottom)
        if agl[1]:
            high = np.fmin(high + (top + TUBE_MARGIN_M), numbers[BAND_HIGH])
            high = np.where(np.isnan(ground[:, 3:5]), np.inf, high)
        else:
            high = np.full_like(high, top)
        out.append(Band(zone, s0, s1, s, low - error, high + error))
    return tuple(out)


def _between(track: Floats, length: Floats, s0: float, s1: float) -> Floats:
    """The points of a track from ``s0`` to ``s1`` metres along it."""
    inner = (length > s0) & (length < s1)
    ends = [np.array([np.interp(s, length, track[:, k]) for k in range(2)]) for s in (s0, s1)]
    return np.ascontiguousarray(np.vstack([ends[0], track[inner], ends[1]]))


def cut(tube: Tube, s0_m: float, s1_m: float) -> Tube | None:
    """The part of a tube from ``s0_m`` to ``s1_m``, its ``s_m`` counted from 0; None if it is shorter than 1e-6 m."""
    if s1_m - s0_m < 1e-6:
        return None
    s, (floor, ceiling) = _cut_pieces(tube.s_m, (tube.floor_m, tube.ceiling_m), s0_m, s1_m)
    bands = []
    for b in tube.bands:
        low, high = max(float(b.s_m[0]), s0_m), min(float(b.s_m[-1]), s1_m)
        if high - low > 0.0:
            bs, (bottom, top) = _cut_pieces(b.s_m, (b.bottom_m, b.top_m), low, high)
            bs = bs - s0_m
            bands.append(Band(b.zone, float(bs[0]), float(bs[-1]), bs, bottom, top))
    return Tube(s - s0_m, floor, ceiling, tuple(bands))


def _cut_pieces(s: Floats, values: tuple[Floats, Floats], s0: float, s1: float) -> tuple[Floats, tuple[Floats, Floats]]:
    i = min(max(int(np.searchsorted(s, s0, "right")) - 1, 0), len(s) - 2)
    j = min(max(int(np.searchsorted(s, s1, "left")), i + 1), len(s) - 1)
    out = s[i : j + 1].copy()
    u = (s0 - out[0]) / (out[1] - out[0])
    v = (s1 - out[-2]) / (out[-1] - out[-2])
    out[0], out[-1] = s0, s1
    cuts = []
    for value in values:
        part = value[i:j].copy()
        first, last = value[i].copy(), value[j - 1].copy()
        if u > 0.0 and np.isfinite(first).all():
            part[0, 0] = first[0] + u * (first[1] - first[0])
        if v < 1.0 and np.isfinite(last).all():
            part[-1, 1] = last[0] + v * (last[1] - last[0])
        cuts.append(part)
    return out, (cuts[0], cuts[1])


def join(tubes: Sequence[Tube]) -> Tube:
    """Join tubes end to end. Bands of one zone that touch become one band, so that one side is chosen for both."""
    if len(tubes) == 1:
        return tubes[0]
    offsets = np.concatenate([[0.0], np.cumsum([t.s_m[-1] for t in tubes])])
    s = np.concatenate([tubes[0].s_m] + [t.s_m[1:] + o for t, o in zip(tubes[1:], offsets[1:], strict=False)])
    floor = np.concatenate([t.floor_m for t in tubes])
    ceiling = np.concatenate([t.ceiling_m for t in tubes])
    bands: list[Band] = []
    for t, o in zip(tubes, offsets, strict=False):
        for b in t.bands:
            moved = Band(b.zone, b.s0_m + o, b.s1_m + o, b.s_m + o, b.bottom_m, b.top_m)
            for k in range(len(bands) - 1, -1, -1):
                if bands[k].zone == b.zone:
                    if abs(bands[k].s1_m - moved.s0_m) < 1e-6:
                        a = bands[k]
                        moved = Band(
                            b.zone,
                            a.s0_m,
                            moved.s1_m,
                            np.concatenate([a.s_m, moved.s_m[1:]]),
                            np.concatenate([a.bottom_m, moved.bottom_m]),
                            np.concatenate([a.top_m, moved.top_m]),
                        )
                        del bands[k]
                    break
            bands.append(moved)
    return Tube(s, floor, ceiling, tuple(bands))
