"""Spoilt files of zones, as they are published or drawn, in every format: read, or refused in words; nothing vanishes.

    python -m tests.campaigns.published --seconds 600 [--seed 1] [--inputs 2000] [--formats openair,kml]

An input is a file of some zones of one format, spoilt as transfers, editors and exports do: lines that lack, stand
twice, are cut or have other letters; members of JSON that lack or are something else; another encoding; the end cut
off. It is read by `read_zones` by one of the rules of ``on_bad``, and with or without ``ignore``. Without the code
under test its elements are counted here, and those that nothing was done to.

A fault is an error that is no InputError, a refusal without a place or words, an element of a file that was read which
is neither a zone nor named, or one that was left alone and is another zone than in the whole file. Exits with 1 and
prints the seed if there is one; ``--seed S --inputs 1 --formats F`` repeats it.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import dropwhile
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.published.unused import listed
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import ZoneDraft, one_line, zone_notes
from gcsplan.mission_file.zones.file import ZoneFile
from tests.mission_file.published.made import ed269, ed318, openaip, volume
from tests.support.attacks import require_placed_words

MAX_FOUND = 20
RULES: tuple[Any, ...] = (None, None, "refuse", "strict", "skip", "skip")
IGNORED: tuple[Any, ...] = ((), (), ("points", "lines", "empty"))
JUNK: tuple[Any, ...] = (
    None, True, -1, 0, 1e9, "", "x", "120 m", "FL 95", [], {}, [[]], [1, 2], "Point", [[14.5, 46.0]], 91, "9" * 40,
)  # fmt: skip
ENCODINGS = ("utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16")


@dataclass(frozen=True)
class Element:
    """One element of a file: what it holds, and words of which the notes must have one if it is no zone."""

    content: str
    words: tuple[str, ...]


def square(rng: random.Random) -> list[list[float]]:
    """A closed ring somewhere near 46 N 14.5 E or far away, [longitude, latitude]."""
    lon, lat, size = rng.choice([14.5, 14.9, -60.0]) + rng.random(), 46.0 + rng.random(), rng.uniform(0.001, 0.05)
    return [[lon, lat], [lon + size, lat], [lon + size, lat + size], [lon, lat + size], [lon, lat]]


def degrees(lat: float, lon: float, style: int) -> str:
    """A place of OpenAir in one of its styles."""
    parts = []
    for value, sides, width in ((lat, "NS", 2), (lon, "EW", 3)):
        whole, side = abs(value), sides[value < 0.0]
        d, m, s = int(whole), int(whole * 60) % 60, round(whole * 3600 % 60, 2)
        m, s = (m, s) if s < 60.0 else (m, 59.99)
        text = f"{d:0{width}d}:{m:02d}:{s:05.2f}" if style != 1 else f"{d:0{width}d}{m:02d}{s:05.2f}"
        parts.append(f"{text} {side}" if style == 0 else f"{text}{side}" if style == 1 else f"{side}{text}")
    return " ".join(parts)


def openair(rng: random.Random, count: int) -> str:
    lines = ["* made"]
    for k in range(count):
        floor = rng.choice(["AL GND", "AL", "AL 1500 FT"])
        lines += [f"AC {rng.choice(['R', 'CTR', 'G', 'D'])}", f"AN zone {k}", floor,
                  rng.choice(["AH FL 95", "AH 3500FT AMSL", "AH UNL"])]  # fmt: skip
        ring, style = square(rng), rng.randrange(3)
        if rng.random() < 0.3:
            radius = rng.choice([0.5, 5.0, 60.0, 200.0])
            lines += [f"V X={degrees(ring[0][1], ring[0][0], style)}", f"DC {radius}"]
        else:
            lines += [f"DP {degrees(lat, lon, style)}" for lon, lat in ring]
        lines.append("")
    return "\n".join(lines)


def _volume(rng: random.Random) -> dict[str, Any]:
    circle = {"type": "Circle", "center": square(rng)[0], "radius": rng.choice([100, 9000, 120_000])}
    shape = circle if rng.random() < 0.3 else {"type": "Polygon", "coordinates": [square(rng)]}
    return volume(horizontalProjection=shape)


def _restriction(rng: random.Random) -> str:
    return rng.choice(["PROHIBITED", "REQ_AUTHORISATION", "NO_RESTRICTION"])


def of_ed269(rng: random.Random, count: int) -> Any:
    return {"features": [ed269(*(_volume(rng) for _ in range(rng.randint(1, 2))), name=f"zone {k}", identifier=f"Z{k}",
                               restriction=_restriction(rng)) for k in range(count)]}  # fmt: skip


def of_ed318(rng: random.Random, count: int) -> Any:
    features = []
    for k in range(count):
        one = ed318({"type": "Polygon", "coordinates": [square(rng)]})
        one["properties"] |= {"name": f"zone {k}", "identifier": f"Z{k}"}
        features.append(one)
    return {"type": "FeatureCollection", "features": features}


def of_openaip(rng: random.Random, count: int) -> Any:
    shapes = [{"type": "Polygon", "coordinates": [square(rng)]} for _ in range(count)]
    return {"items": [openaip(name=f"zone {k}", geometry=shape) for k, shape in enumerate(shapes)]}


def of_geojson(rng: random.Random, count: int) -> Any:
    features = []
    for k in range(count):
        ring = square(rng)
        shape: Any = rng.choice([
            {"type": "Polygon", "coordinates": [ring]},
            {"type": "MultiPolygon", "coordinates": [[ring], [square(rng)]]},
            {"type": "Point", "coordinates": ring[0]}, {"type": "LineString", "coordinates": ring[:3]}, None,
            {"type": "GeometryCollection", "geometries": [{"type": "Polygon", "coordinates": [ring]}]},
        ])  # fmt: skip
        size = {"radius_m": 50} if rng.random() < 0.5 else {"buffer_m": 20}
        properties = {"name": f"zone {k}", "upper": "120 M AGL"} | (size if rng.random() < 0.5 else {})
        features.append({"type": "Feature", "properties": properties, "geometry": shape})
    return {"type": "FeatureCollection", "features": features}


def of_states_geojson(rng: random.Random, count: int) -> Any:
    members = [{"identifier": f"Z{k}", "name": f"zone {k}", "restriction": _restriction(rng), "uomDimensions": "M",
                "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120, "upperVerticalReference": "AGL",
                "applicability": [{"permanent": "YES"}]} for k in range(count)]  # fmt: skip
    features = [{"type": "Feature", "properties": one, "geometry": {"type": "Polygon", "coordinates": [square(rng)]}}
                for one in members]  # fmt: skip
    return {"type": "FeatureCollection", "features": features}


def kml(rng: random.Random, count: int) -> str:
    lines = ['<kml xmlns="http://www.opengis.net/kml/2.2">', "<Document>"]
    for k in range(count):
        ring = " ".join(f"{lon:.6f},{lat:.6f},0" for lon, lat in square(rng))
        polygon = f"<Polygon><outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates></LinearRing>"
        shape = rng.choice([f"{polygon}</outerBoundaryIs></Polygon>"] * 3
                           + [f"<Point><coordinates>{ring.split()[0]}</coordinates></Point>", "",
                              f"<LineString><coordinates>{ring}</coordinates></LineString>"])  # fmt: skip
        lines += ["<Placemark>", f"<name>zone {k}</name>", shape, "</Placemark>"]
    return "\n".join([*lines, "</Document>", "</kml>"])


def csv(rng: random.Random, count: int) -> str:
    sign = rng.choice([",", ";", "\t"])
    rows = [["name", "lat", "lon", "height_m", "radius_m"]]
    for k in range(count):
        lon, lat = square(rng)[0]
        rows.append([f"zone {k}", f"{lat:.5f}", f"{lon:.5f}", rng.choice(["95", ""]), rng.choice(["60", "60", ""])])
    return "\n".join(([f"sep={sign}"] if rng.random() < 0.3 else []) + [sign.join(row) for row in rows])


def fence(rng: random.Random, count: int) -> str:
    rows: list[tuple[int, float, float, float]] = [(16, 0, 46.0, 14.5)]
    for _ in range(count):
        ring = square(rng)[:4]
        if rng.random() < 0.3:
            rows.append((5004, rng.choice([50, 2000]), ring[0][1], ring[0][0]))
        else:
            rows += [(5002, len(ring), lat, lon) for lon, lat in ring]
    items = [
        f"{k}\t{int(not k)}\t3\t{c}\t{p}\t0\t0\t0\t{lat:.7f}\t{lon:.7f}\t0\t1"
        for k, (c, p, lat, lon) in enumerate(rows)
    ]
    return "\n".join(["QGC WPL 110", *items])


def poly(rng: random.Random, count: int) -> str:
    return "\n".join(["#saved by Mission Planner 1.3.80", *(f"{lat:.7f} {lon:.7f}" for lon, lat in square(rng))])


FORMATS: dict[str, tuple[str, Callable[[random.Random, int], Any]]] = {
    "openair": (".txt", openair), "ed269": (".json", of_ed269), "ed318": (".json", of_ed318),
    "openaip": (".json", of_openaip), "geojson": (".geojson", of_geojson), "state": (".geojson", of_states_geojson),
    "kml": (".kml", kml), "csv": (".csv", csv), "fence": (".waypoints", fence), "poly": (".poly", poly),
}  # fmt: skip
"""The ending and the writer of each format: text, or what JSON holds."""


def spoilt_text(rng: random.Random, text: str) -> str:
    lines = text.split("\n")
    for _ in range(rng.randint(0, 3)):
        k = rng.randrange(len(lines))
        line = lines[k]
        how = rng.randrange(6)
        if how == 0:
            del lines[k]
        elif how == 1:
            lines.insert(k, line)
        elif how == 2:
            lines[k] = line[: rng.randrange(len(line) + 1)]
        elif how == 3 and line:
            at = rng.randrange(len(line))
            lines[k] = line[:at] + rng.choice("xN9:., <>\0é") + line[at + 1 :]
        elif how == 4:
            lines.insert(k, rng.choice(["", "hello world", "1,2,3", "* a comment", "<!-- c -->"]))
        else:
            lines[k] = re.sub(r"\d+", lambda m: rng.choice([m[0], m[0], "x", "999999", ""]), line, count=3)
        lines = lines or [""]
    whole = "\n".join(lines)
    return whole[: rng.randrange(len(whole) + 1)] if rng.random() < 0.05 else whole


def spoilt_value(rng: random.Random, value: Any) -> Any:
    """A copy in which one member, at any depth, is another or lacks."""
    if isinstance(value, dict | list) and value and rng.random() < 0.85:
        copy: Any = value.copy()
        key = rng.choice(sorted(copy)) if isinstance(copy, dict) else rng.randrange(len(copy))
        if rng.random() < 0.1:
            del copy[key]
        else:
            copy[key] = spoilt_value(rng, copy[key])
        return copy
    return rng.choice(JUNK)


def elements(form: str, content: Any) -> dict[str, Element]:
    """The elements of a file by their places, as far as its format can still be seen."""
    if not isinstance(content, str):
        key = "items" if form == "openaip" else "features"
        found = content.get(key) if isinstance(content, dict) else None
        made = {}
        for i, one in enumerate(found if isinstance(found, list) else []):
            named = one.get("properties", one) if isinstance(one, dict) else {}
            # A zone without a name goes by its identifier.
            names = [named.get(k) for k in ("name", "identifier")] if isinstance(named, dict) else []
            name = next((n.strip() for n in names if isinstance(n, str) and n.strip()), f"[{i}]")
            words = (f"{key}[{i}]", name)
            made[f"{key}[{i}]"] = Element(json.dumps(one), words)
        return made
    lines = content.splitlines()
    if form == "openair":
        records = [line.split("*", 1)[0].strip() for line in lines]
        starts = [i for i, record in enumerate(records) if re.match(r"AC\s+\S", record, re.IGNORECASE)]
        made = {}
        for n, (first, after) in enumerate(zip(starts, [*starts[1:], len(lines)], strict=True)):
            names = [one_line(r[2:].strip()) for r in records[first:after] if r[:3].upper() == "AN "]
            places = [f"line {i + 1}" for i in range(first, after)]
            made[f"line {first + 1}"] = Element(
                "\n".join(filter(None, records[first:after])), (*places, *names[:1], f"a[{n}]")
            )
        return made
    if form == "kml":
        parts = re.split(r"<Placemark>", content)[1:]
        made = {}
        for i, part in enumerate(parts, start=1):
            names = (f"a[{i}]", *map(str.strip, re.findall(r"<name>([^<]+)", part)))
            made[f"Placemark {i}"] = Element(part.split("</Placemark>")[0], (f"Placemark {i}", *names))
        return made
    if form == "csv":
        filled = [(i + 1, line) for i, line in enumerate(lines) if line.strip(" ,;\t")]
        rows = list(dropwhile(lambda row: row[1].startswith("sep="), filled))[1:]
        return {
            f"line {i}": Element(line, (f"line {i}", f"a[{i}]", re.split(r"[,;\t]", line)[0].strip()))
            for i, line in rows
        }
    return {}


def attack(form: str, seed: int, folder: Path) -> tuple[str, list[str]]:
    """Read the spoilt file of that seed; how it ended, and the faults."""
    rng = random.Random(f"{form} {seed}")
    ending, write = FORMATS[form]
    whole = write(rng, rng.randint(2, 6))
    if isinstance(whole, str):
        content: Any = spoilt_text(rng, whole)
    else:
        content = whole
        for _ in range(rng.randint(0, 3)):
            content = spoilt_value(rng, content)
    policy = Policy(where="--zones", on_bad=rng.choice(RULES), ignore=rng.choice(IGNORED))
    path = folder / f"a{ending}"
    path.write_bytes(_bytes(content, rng.choice(ENCODINGS)))
    named = f"seed {seed} ({form}, on_bad {policy.on_bad}, ignore {policy.ignore})"
    try:
        found = read_zones(path, where="--zones", policy=policy)
    except InputError as error:
        require_placed_words(error)
        return "refused", []
    except Exception as error:
        return "error", [f"{named}: {type(error).__name__}: {error}"]
    if found.problems:
        bad = [p for p in found.problems if not (p.where and p.message)]
        return "refused", [f"{named}: a refusal without words"] if bad else []
    faults = [f"{named}: {what}" for what in vanished(found, elements(form, content))]
    if not faults and content != whole:
        path.write_bytes(_bytes(whole, "utf-8"))
        before = read_zones(path, where="--zones", policy=Policy(where="--zones", on_bad="skip", ignore=IGNORED[-1]))
        same = [] if form == "csv" else changed(found, elements(form, content), before, elements(form, whole))
        faults += [f"{named}: {what}" for what in same]
    return "read", faults


def _bytes(content: Any, encoding: str) -> bytes:
    text = content if isinstance(content, str) else json.dumps(content)
    return text.encode(encoding, "replace")


def vanished(found: ZoneFile, present: dict[str, Element]) -> list[str]:
    """The elements that are neither a zone nor named."""
    drafts, notes = listed(found.zones)
    named = "\n".join(str(note) for note in [*found.notes, *notes, *zone_notes([(draft, None) for draft in drafts])])
    return [
        f"{place} ({element.content[:60]!r}) is no zone and not named"
        for place, element in present.items()
        if not _of(found.zones, place) and not any(re.search(rf"{re.escape(w)}(?!\d)", named) for w in element.words)
    ]


def changed(found: ZoneFile, now: dict[str, Element], before: ZoneFile, then: dict[str, Element]) -> list[str]:
    """The elements that nothing was done to, and that are other zones than in the whole file."""
    once = {element.content: place for place, element in then.items()}
    twice = Counter(element.content for element in (*now.values(), *then.values()))
    faults = []
    for place, element in now.items():
        if element.content not in once or twice[element.content] != 2:
            continue
        is_, was = (_shapes(_of(zones, at)) for zones, at in
                    ((found.zones, place), (before.zones, once[element.content])))  # fmt: skip
        if was and is_ and is_ != was:
            faults.append(f"{place} ({element.content[:60]!r}) is {is_}, in the whole file {was}")
        if was and not is_:
            faults.append(f"{place} ({element.content[:60]!r}) is no zone, in the whole file {was}")
    return faults


def _of(drafts: list[ZoneDraft], place: str) -> list[ZoneDraft]:
    return [d for d in drafts if re.search(rf"{re.escape(place)}(?!\d)", d.where)]


def _shapes(drafts: list[ZoneDraft]) -> list[Any]:
    return [(d.points, d.radius_m, d.buffer_m, d.floor, d.ceiling, d.unused and d.unused.code) for d in drafts]


def main() -> int:
    """Run the campaign; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=10**9, help="inputs of each format")
    parser.add_argument("--formats", default=",".join(FORMATS))
    args = parser.parse_args()
    until, seed = time.monotonic() + args.seconds, args.seed
    found: list[str] = []
    ended: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        while seed - args.seed < args.inputs and time.monotonic() < until and len(found) < MAX_FOUND:
            for form in args.formats.split(","):
                how, faults = attack(form, seed, Path(folder))
                ended[form, how] += 1
                found += faults
            seed += 1
    print(f"{sum(ended.values())} inputs, {len(found)} faults")
    for (form, how), count in sorted(ended.items()):
        print(f"  {form}: {how}: {count}")
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
