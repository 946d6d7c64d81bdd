"""Levels of zones along a track, and the widest free altitudes between them.

Where a zone follows ground, a tube takes the steepest slope around each whole piece for the zone's levels, which may be
metres too much on a slope. Here they are read from the zone's own ground, within reach of samples of the track. This is
no proof: the exact check judges the path between the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.taut_string import Profile
from gcsplan.planners.profile.track import Obstruction, Track, denser, make_track, values_at
from gcsplan.world.airspace import Band
from gcsplan.world.geometry.path import distances_m
from gcsplan.world.zone_table import RING_POINTS

LEVEL_SAMPLE_M = 12.0
"""Metres between samples along a track, at most."""
SPARE_M, STEP_M = 0.05, 0.04
"""Metres added to the levels that are read; and metres by which a level is corrected after its first violation in the
exact check, which gives no height. Each further correction is as much as all before."""


def may_pass(problem: Problem, track: Track, shut: Obstruction) -> bool:
    """Whether the exact check may pass a path over a track that is ``shut`` by its tube. A pinched track lacks only
    centimetres there, because cells shut a track that lacks more, and the tube's bands of zones above ground (AGL) are
    wider than the altitudes that the exact check shuts."""
    follows = any(problem.airspace.zones[band.zone].follows_ground for band in track.tube.bands)
    return shut.kind == "pinched" or follows


@dataclass(frozen=True, eq=False, slots=True)
class ZoneLevels:
    """A band with levels read from the zone's own ground around samples of the track, and with their certain limits.

    ``most`` (2, K, 2): the tube's own bottom and top, which hold for certain; ``moved`` (K,): the corrections so far,
    infinite where nothing is left to correct.
    """

    band: Band
    most: Floats
    moved: Floats

    @classmethod
    def of(cls, problem: Problem, track: Track, band: Band) -> ZoneLevels:
        """A band's levels at samples no farther than `LEVEL_SAMPLE_M` apart; the band as it is if they are AMSL."""
        air, zone = problem.airspace, problem.airspace.zones[band.zone]
        if not zone.follows_ground:
            return cls(band, np.stack([band.bottom_m, band.top_m]), np.full(len(band.bottom_m), math.inf))
        parts = max(1, math.ceil((band.s1_m - band.s0_m) / LEVEL_SAMPLE_M))
        s = np.unique(np.concatenate([band.s_m, np.linspace(band.s0_m, band.s1_m, parts + 1)]))
        problem.budget.spend("place", len(s) * RING_POINTS)
        places = np.stack([np.interp(s, track.s_m, track.points[:, k]) for k in range(2)], axis=-1)
        ground = air.zone_table.own_ground_m(band.zone, places, air.beside_m(problem.limits))
        most, found = [], []
        sides = (zone.floor, band.bottom_m, -1.0), (zone.ceiling, band.top_m, 1.0)
        for k, (level, tubes, spare_m) in enumerate(sides):
            whole = values_at(s, band.s_m, tubes, k == 1)
            here = whole
            if level is not None and level.datum == "agl":
                here = _filled(s, ground[k]) + level.value_m + spare_m * (problem.limits.over_zone_m + SPARE_M)
                here = np.minimum(here, whole) if k == 1 else np.maximum(here, whole)
            most.append(np.stack([whole[:-1], whole[1:]], axis=-1))
            found.append(np.stack([here[:-1], here[1:]], axis=-1))
        closer = Band(band.zone, band.s0_m, band.s1_m, s, *found)
        return cls(closer, np.stack(most), np.zeros(len(s) - 1))

    @property
    def follows_ground(self) -> bool:
        """Whether a level is read from the ground."""
        return bool(np.isfinite(self.moved).any())

    def correct(self, profile: Profile, s0_m: float, s1_m: float) -> bool:
        """Widen the pieces of the band whose levels ``profile`` touches between two places along the track; return
        whether any could be widened."""
        band = self.band
        z = np.stack([profile.at(band.s_m[:-1]), profile.at(band.s_m[1:])], axis=-1)
        apart_m = np.maximum(band.bottom_m - z, z - band.top_m).min(axis=1)
        here = (band.s_m[1:] > s0_m) & (band.s_m[:-1] < s1_m) & np.isfinite(self.moved)
        # A level that was read too low may lie under a profile that keeps more from it for another reason.
        nearest_m = float(apart_m[here].min(initial=math.inf))
        touched = here & (apart_m < max(nearest_m, 0.0) + STEP_M)
        step_m = np.maximum(self.moved, np.maximum(apart_m, 0.0) + STEP_M)[touched]
        self.moved[touched] += step_m
        bottom, top = band.bottom_m[touched] - step_m[:, None], band.top_m[touched] + step_m[:, None]
        least, most = self.most[:, touched]
        # Where no sample saw ground under the zone, nothing less than the tube's level is known.
        band.bottom_m[touched] = np.where(np.isfinite(bottom), np.maximum(bottom, least), least)
        band.top_m[touched] = np.where(np.isfinite(top), np.minimum(top, most), most)
        ended = (band.bottom_m <= self.most[0]).all(axis=1) & (band.top_m >= self.most[1]).all(axis=1)
        self.moved[ended] = math.inf
        return bool(touched.any())


def _filled(s_m: Floats, ground: Floats) -> Floats:
    """Ground (N,) along a track; where none is known, the ground of the nearest places: at a zone's rim, little of its
    ground is within reach, and samples may miss it."""
    known = np.isfinite(ground)
    return np.asarray(np.interp(s_m, s_m[known], ground[known]) if known.any() else ground)


def widest_free(
    problem: Problem, track: Track, s_m: Floats, floor_m: Floats, cap_m: float, enough_m: float
) -> tuple[Floats, Floats]:
    """(N,) the lowest and the highest altitude of the widest free interval at places ``s_m`` (N,) along a track, from
    the floors there to a cap, between the zones; if several are ``enough_m`` wide, the highest of them. The lowest
    altitude is above the highest where none is free."""
    bands = []
    for band in (ZoneLevels.of(problem, track, of).band for of in track.tube.bands):
        within = (s_m >= band.s0_m) & (s_m <= band.s1_m)
        bottom, top = (values_at(s_m, band.s_m, of, k == 1) for k, of in enumerate((band.bottom_m, band.top_m)))
        bands.append((np.where(within, bottom, math.inf), np.where(within, top, -math.inf)))
    low, high = floor_m, np.full_like(floor_m, -math.inf)
    for start in (floor_m, *(top for _, top in bands)):
        begin, end = np.maximum(start, floor_m), np.full_like(floor_m, cap_m)
        for bottom, top in bands:
            end = np.where(top > begin, np.minimum(end, bottom), end)
        with np.errstate(invalid="ignore"):  # both may be infinite, and then nothing is free
            wide, known = np.minimum(end - begin, enough_m), np.minimum(high - low, enough_m)
        better = (wide > known) | ((wide == known) & (begin > low))
        low, high = np.where(better, begin, low), np.where(better, end, high)
    return low, high


def free_below(problem: Problem, places: Floats, cap_m: float, enough_m: float) -> tuple[Floats, Floats]:
    """`widest_free` at the vertices (N, 2) of a track."""
    ends = np.isin(np.arange(len(places)), [0, len(places) - 1])
    track = make_track(problem, places, ends, np.full(len(places), math.nan))
    return widest_free(problem, track, distances_m(places), problem.floors(*places.T), cap_m, enough_m)


def shut_places(problem: Problem, points: Floats, cap_m: float, step_m: float) -> Floats:
    """(K, 2) the places of a track (N, 2), ``step_m`` apart at most, over which no altitude is free below a cap."""
    places = denser(points, step_m)
    low, high = free_below(problem, places, cap_m, 0.0)
    return np.asarray(places[low > high])
