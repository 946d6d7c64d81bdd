"""Polygons on the globe, in every format, against point-in-polygon by each format's own edges.

    python -m tests.campaigns.zones --seconds 120 [--seed 1] [--inputs N]

An input is one or two random polygons: narrow or up to a turn wide, in either convention of longitudes, across the
antimeridian, at a pole, with a hole, split, of several parts with several holes. It is written in one format and read
by `read_zones`; then places inside and outside it are looked up. The answer that is right is computed here, without the
code under test: longitudes count as they are written, edges are straight in degrees, and in formats that do not state
it great circles as well, whose latitude at a longitude comes from the plane through the centre of the Earth. Each
fourth input is a circle, a corridor or a polygon in another coordinate system (`zone_shapes`).

A fault is a place that the format has inside the zone (its holes too, since they count as no-fly) and that gcsplan
neither refuses nor has in a zone; or one that is well outside and in a zone. Exits with 1 and prints the seed if there
is one; ``--seed S --inputs 1`` repeats it.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gcsplan.errors import InputError
from gcsplan.mission_file.published.unused import used
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import place_zones
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Polygon
from tests.campaigns import zone_shapes
from tests.support.zone_files import EITHER_EDGE, WRITERS, Part, Ring

NEAR_BORDER_M = 4.0
"""Places nearer to an edge than this, m, are not judged: edges are kept to 5 cm, great circles to 1 m, NAD83 to 2 m."""

PLACES = 24
MAX_FOUND = 20


def polygon(rng: random.Random) -> tuple[str, list[Part]]:
    """A kind of polygon and its parts."""
    kind = rng.choice(["narrow", "wide", "world", "many corners", "across", "written across", "split", "pole", "hole",
                       "hole in world", "360", "long edge", "tip at the pole", "steep", "islands"])  # fmt: skip
    lat, lon = rng.uniform(-70.0, 70.0), rng.uniform(-180.0, 180.0)
    if kind == "narrow":
        return kind, [[_star(rng, lon, lat, rng.uniform(0.05, 15.0), 0.0)]]
    if kind == "tip at the pole":
        sign, wide = rng.choice([-1.0, 1.0]), rng.uniform(1.0, 80.0)
        base = [(lon - wide, sign * rng.uniform(40.0, 70.0)), (lon + wide, sign * rng.uniform(40.0, 70.0))]
        tip = [(lon + rng.uniform(-wide, wide), sign * 90.0)] if rng.random() < 0.5 else [
            (lon + wide, sign * 90.0), (lon - wide, sign * 90.0)
        ]  # fmt: skip
        return kind, [[base + tip if rng.random() < 0.5 else (base + tip)[::-1]]]
    if kind == "steep":  # long edges that run nearly north
        tall, wide = rng.uniform(1.0, 14.0), 10.0 ** rng.uniform(-3.0, 0.0)
        return kind, [[[(lon, lat - tall), (lon + wide, lat + tall), (lon - wide * rng.uniform(0.5, 9.0), lat + tall)]]]
    if kind == "360":
        return kind, [[_star(rng, rng.uniform(0.0, 350.0), lat, rng.uniform(0.05, 9.0), 0.0)]]
    if kind in ("wide", "world", "many corners", "long edge"):
        west = -180.0 if kind == "world" else rng.uniform(-180.0, -60.0)
        east = 180.0 if kind == "world" else rng.uniform(60.0, 180.0)
        south, north = rng.uniform(-85.0, 0.0), rng.uniform(5.0, 85.0)
        ring = _band(rng, west, east, south, north, 1 if kind in ("long edge", "world") else rng.choice([1, 2, 3, 9]))
        return kind, [[ring if rng.random() < 0.5 else ring[::-1]]]
    if kind in ("across", "written across"):
        ring = _star(rng, rng.choice([-180.0, 180.0]), lat, rng.uniform(0.02, 8.0), 0.0)
        if kind == "written across":
            ring = [((x + 180.0) % 360.0 - 180.0, y) for x, y in ring]
        return kind, [[ring if rng.random() < 0.5 else ring[::-1]]]
    if kind == "split":
        half, south, north = rng.uniform(0.1, 10.0), lat - rng.uniform(0.1, 9.0), lat + rng.uniform(0.1, 9.0)
        return kind, [
            [_band(rng, 180.0 - half, 180.0, south, north, 1)],
            [_band(rng, -180.0, half - 180.0, south, north, 1)],
        ]
    if kind == "pole":
        sign, reach = rng.choice([-1.0, 1.0]), rng.uniform(55.0, 85.0)
        lons = [-180.0 + 360.0 * i / 8 for i in range(9)]
        if rng.random() < 0.5:  # a form of RFC 7946: along the pole
            return kind, [[[*((x, sign * reach) for x in lons), (180.0, sign * 90.0), (-180.0, sign * 90.0)]]]
        return kind, [[[(x, sign * reach) for x in lons[:-1]]]]
    if kind == "hole":
        ring = _star(rng, lon, lat, rng.uniform(1.0, 9.0), 0.0)
        return kind, [[ring, [(lon, lat), (lon + 0.02, lat), (lon, lat + 0.02)]]]
    if kind == "islands":  # one zone of several parts, each with lakes
        return kind, [_island(rng, lon + 25.0 * k, 0.8 * lat) for k in range(rng.randint(2, 5))]
    hole = [(lon * 0.8, lat * 0.8), (lon * 0.8 + 3.0, lat * 0.8), (lon * 0.8, lat * 0.8 + 2.0)]
    return kind, [[_band(rng, -179.9, 179.9, -80.0, 80.0, rng.choice([1, 4])), hole]]


def _star(rng: random.Random, lon: float, lat: float, size: float, turn: float) -> list[tuple[float, float]]:
    count = rng.randint(3, 8)
    bearings = sorted(rng.uniform(0.0, 2.0 * math.pi) for _ in range(count))
    size = min(size, 84.0 - abs(lat))
    return [
        (lon + turn + 1.2 * (r := size * rng.uniform(0.4, 1.0)) * math.cos(b), lat + r * math.sin(b)) for b in bearings
    ]


def _island(rng: random.Random, lon: float, lat: float) -> Part:
    size = 10.0 ** rng.uniform(-2.0, 0.8)
    lakes = [(lon + 0.15 * size * (k - 1), lat) for k in range(rng.randint(0, 3))]
    return [
        _star(rng, lon, lat, size, 0.0),
        *([(x, y), (x + 0.1 * size, y), (x, y + 0.1 * size)] for x, y in lakes),
    ]


def _band(
    rng: random.Random, west: float, east: float, south: float, north: float, pieces: int
) -> list[tuple[float, float]]:
    along = [west + (east - west) * i / pieces for i in range(pieces + 1)]
    bend = rng.choice([0.0, 0.0, 3.0]) if pieces > 1 else 0.0
    below = [(x, south + (bend * rng.random() if 0 < i < pieces else 0.0)) for i, x in enumerate(along)]
    return below + [(x, north) for x in reversed(along)]


def inside(ring: Ring, lon: float, lat: float, *, great_circles: bool) -> bool:
    """Whether a place is inside a ring as it is written: how many edges lie north of it on its meridian."""
    return any(
        _crossings(ring, lon + turn, lat, great_circles) % 2 == 1 for turn in (-720.0, -360.0, 0.0, 360.0, 720.0)
    )


def _crossings(ring: Ring, lon: float, lat: float, great_circles: bool) -> int:
    count = 0
    for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True):
        if (x0 > lon) != (x1 > lon):
            count += latitude_at(x0, y0, x1, y1, lon, great_circles=great_circles) > lat
    return count


def latitude_at(x0: float, y0: float, x1: float, y1: float, lon: float, *, great_circles: bool) -> float:
    """The latitude of an edge at a longitude that it passes."""
    if not great_circles or y0 == y1 == math.copysign(90.0, y0):
        return y0 + (y1 - y0) * (lon - x0) / (x1 - x0)
    if 90.0 in (abs(y0), abs(y1)):  # along the pole, and then along a meridian
        return y0 if abs(y0) == 90.0 else y1
    (ax, ay, az), (bx, by, bz) = _on_sphere(x0, y0), _on_sphere(x1, y1)
    east, north, up = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    along = east * math.cos(math.radians(lon)) + north * math.sin(math.radians(lon))
    return math.degrees(math.atan2(math.copysign(along, -along * up), abs(up)))


def _on_sphere(lon: float, lat: float) -> tuple[float, float, float]:
    x, y = math.radians(lon), math.radians(lat)
    return math.cos(y) * math.cos(x), math.cos(y) * math.sin(x), math.sin(y)


def held(ring: Ring, lon: float, lat: float, form: str) -> bool:
    """Whether the format has the place inside the ring."""
    straight = inside(ring, lon, lat, great_circles=False)
    short = shorter(ring) if form in EITHER_EDGE else None
    return straight or (short is not None and inside(short, lon, lat, great_circles=True))


def shorter(ring: Ring) -> Ring | None:
    """A ring with edges the shorter way, which great circles go; None if it then does not close."""
    found = [ring[0]]
    for lon, lat in [*ring[1:], ring[0]]:
        found.append((found[-1][0] + (lon - found[-1][0] + 180.0) % 360.0 - 180.0, lat))
    return found[:-1] if abs(found[-1][0] - ring[0][0]) < 1.0 else None


def between_edges(ring: Ring, lon: float, lat: float, form: str) -> bool:
    """Whether a place lies between a straight edge and its great circle: mixed, they may enclose it."""
    if form not in EITHER_EDGE:
        return False
    for turn in (-720.0, -360.0, 0.0, 360.0, 720.0):
        x = lon + turn
        for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True):
            if (x0 > x) != (x1 > x):
                north = {latitude_at(x0, y0, x1, y1, x, great_circles=bent) > lat for bent in (False, True)}
                if len(north) == 2:
                    return True
    return False


def certain(parts: Sequence[Part], lon: float, lat: float, form: str) -> bool | None:
    """Whether the format has the place inside a part; None near a border, and where edges of both kinds may hold it."""
    wide, off = math.cos(math.radians(lat)), NEAR_BORDER_M / 111_000.0
    corners = [((x - lon + 180.0) % 360.0 - 180.0, y - lat) for p in parts for x, y in p[0]]
    if any(math.hypot(wide * x, y) < off for x, y in corners):  # a tip may be narrower than the places looked at
        return None
    answers = {
        any(held(p[0], lon + dx * size / wide, lat + dy * size, form) for p in parts)
        for dx in (-1.0, 0.0, 1.0) for dy in (-1.0, 0.0, 1.0) for size in (off, 0.1 * off)
    }  # fmt: skip
    answer = answers.pop() if len(answers) == 1 else None
    return None if answer is False and any(between_edges(p[0], lon, lat, form) for p in parts) else answer


def places(rng: random.Random, parts: Sequence[Part]) -> list[tuple[float, float]]:
    """(longitude, latitude) of places around corners, edges, within and anywhere."""
    corners = [c for p in parts for c in p[0]]
    found = []
    for _ in range(PLACES):
        (x0, y0), (x1, y1) = rng.choice(corners), rng.choice(corners)
        part, near = rng.random(), rng.choice([0.0, 0.001, 0.1, 2.0])
        x, y = x0 + part * (x1 - x0) + rng.gauss(0.0, near), y0 + part * (y1 - y0) + rng.gauss(0.0, near)
        if rng.random() < 0.2:
            x, y = rng.uniform(-180.0, 180.0), rng.uniform(-80.0, 80.0)
        if abs(y) < 83.0:
            found.append(((x + 180.0) % 360.0 - 180.0, y))
    return found


def attack(seed: int, folder: Path) -> tuple[str, str, list[str]]:
    """Read the input of that seed; return its kind and format, how it ended, and the faults."""
    rng = random.Random(seed)
    kind, parts = polygon(rng)
    form = rng.choice([*WRITERS])
    if form == "mercator" and (kind in ("pole", "360") or not all(abs(y) < 84.0 for p in parts for _, y in p[0])):
        form = "nad83"
    if form == "mercator":  # other edges are no straight lines in degrees
        parts = [[_level(p[0])] for p in parts]
        kind = kind.removeprefix("written ")  # in metres it is as wide as it is drawn
    named = f"{kind}, {form}"
    try:
        found = read_zones(WRITERS[form](folder, parts), where="zones")
        problems = [p.message for p in found.problems]
    except InputError as why:
        problems = [p.message for p in why.problems]
    if problems:
        return named, f"refused: {reason(problems[0])}", []
    if found.zones and all(draft.keep_in for draft in found.zones):  # a world: its holes are what is read
        parts = [[hole] for part in parts for hole in part[1:]]
    faults: list[str] = []
    refused = 0
    looked = places(rng, parts)
    for lon, lat in looked:
        right = certain(parts, lon, lat, form)
        frame = Frame(lat + rng.uniform(-0.9, 0.9), (lon + rng.uniform(-0.9, 0.9) + 180.0) % 360.0 - 180.0)
        answer = answered(used(found.zones), frame, lon, lat)
        refused += answer is None
        if answer is None or right is None or answer == right:
            continue
        if answer and kind == "written across":
            continue  # a place in the zone besides is no fault there: the zone is the other side
        faults.append(f"seed {seed} ({named}): {lat:.6f}, {lon:.6f} is {'inside' if right else 'outside'}, read as "
                      f"{'inside' if answer else 'free'}")  # fmt: skip
    if kind == "written across":
        faults = across_faults(seed, named, parts, looked, used(found.zones))
    return named, "refused in the band only" if refused == len(looked) else "read", faults


def across_faults(
    seed: int, named: str, parts: Sequence[Part], looked: Sequence[tuple[float, float]], zones: Sequence[object]
) -> list[str]:
    """Faults of a zone that crosses the antimeridian and is written with longitudes within 180°.

    It is the zone across it near there, and a mission where it would be if it went around the other side is refused.
    """
    past = [(x + 360.0 if x < 0.0 else x, y) for x, y in parts[0][0]]
    faults = []
    for lon, lat in looked:
        answer = answered(zones, Frame(lat, lon), lon, lat)
        if certain([[past]], lon, lat, "geojson") and answer is False:
            faults.append(
                f"seed {seed} ({named}): {lat:.6f}, {lon:.6f} is inside across the antimeridian, read as free"
            )
        far = 15.0 < (lon - 180.0) % 360.0 < 345.0 and abs(lat) < 75.0
        if far and certain(parts, lon, lat, "geojson") and answer is False:
            faults.append(f"seed {seed} ({named}): {lat:.6f}, {lon:.6f} is inside as written, read as free")
    return faults


def _level(ring: Ring) -> Ring:
    (west, south), (east, north) = np.min(ring, axis=0), np.max(ring, axis=0)
    return [(float(x), float(y)) for x, y in ((west, south), (east, south), (east, north), (west, north))]


def answered(drafts: Sequence[object], frame: Frame, lon: float, lat: float) -> bool | None:
    """Whether a place is in a zone as gcsplan places them; None if a mission there is refused."""
    at = frame.to_plane(lat, lon)
    hit = False
    for draft, zone in place_zones(drafts, frame)[0]:  # type: ignore[arg-type]
        assert isinstance(zone.shape, Polygon)
        corners = zone.shape.vertices - at
        after = np.roll(corners, -1, axis=0)
        spans = (corners[:, 1] > 0.0) != (after[:, 1] > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            east = corners[:, 0] - corners[:, 1] * (after - corners)[:, 0] / (after - corners)[:, 1]
        if np.count_nonzero(spans & (east > 0.0)) % 2:
            if draft.faults:
                return None
            hit = True
    return hit


def reason(message: str) -> str:
    """A refusal without its numbers and names."""
    return re.sub(r"zone '[^']*': |-?\d+(\.\d+)?(e-?\d+)?", "", message)[:60]


def main() -> int:
    """Run the campaign; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=10**9)
    args = parser.parse_args()
    until, seed = time.monotonic() + args.seconds, args.seed
    found: list[str] = []
    ended: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        while seed - args.seed < args.inputs and time.monotonic() < until and len(found) < MAX_FOUND:
            named, how, faults = (zone_shapes.attack if seed % 4 == 0 else attack)(seed, Path(folder))
            ended[reason(how) if how.startswith("refused:") else how] += 1
            kinds[f"{named.split(',')[0]}: {how.split(':')[0]}"] += 1
            found += faults
            seed += 1
    print(f"{seed - args.seed} inputs, {len(found)} faults")
    for how, count in ended.most_common():
        print(f"  {how}: {count}")
    for what, count in sorted(kinds.items()):
        print(f"    {what}: {count}")
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
