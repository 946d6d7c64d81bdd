"""Cutting and joining tubes, so that after a change of the track only the changed part needs a new tube."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.airspace import Band, Tube


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
