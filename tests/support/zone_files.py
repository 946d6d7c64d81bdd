"""One polygon with holes, or several, written in every format that gcsplan reads zones from."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Ring = Sequence[tuple[float, float]]
"""Corners (longitude, latitude), not closed."""

Part = Sequence[Ring]
"""An outline and its holes."""


def _closed(part: Part) -> list[list[list[float]]]:
    return [[[lon, lat] for lon, lat in [*ring, ring[0]]] for ring in part]


def _polygons(parts: Sequence[Part]) -> dict[str, Any]:
    if len(parts) == 1:
        return {"type": "Polygon", "coordinates": _closed(parts[0])}
    return {"type": "MultiPolygon", "coordinates": [_closed(p) for p in parts]}


def geojson(folder: Path, parts: Sequence[Part]) -> Path:
    """RFC 7946."""
    feature = {"type": "Feature", "properties": {"name": "z"}, "geometry": _polygons(parts)}
    return _json(folder / "z.geojson", {"type": "FeatureCollection", "features": [feature]})


def kml(folder: Path, parts: Sequence[Part]) -> Path:
    """KML 2.2."""

    def ring(kind: str, corners: Ring) -> str:
        text = " ".join(f"{lon!r},{lat!r}" for lon, lat in [*corners, corners[0]])
        return f"<{kind}><LinearRing><coordinates>{text}</coordinates></LinearRing></{kind}>"

    shapes = "".join(
        f"<Polygon>{ring('outerBoundaryIs', p[0])}{''.join(ring('innerBoundaryIs', h) for h in p[1:])}</Polygon>"
        for p in parts
    )
    file = folder / "z.kml"
    file.write_text(
        f"<kml><Placemark><name>z</name><MultiGeometry>{shapes}</MultiGeometry></Placemark></kml>", encoding="utf-8"
    )
    return file


def openair(folder: Path, parts: Sequence[Part]) -> Path:
    """OpenAir, which has no holes: they are left out."""

    def angle(value: float, sides: str) -> str:
        return f"{abs(value):.12f} {sides[value < 0.0]}"

    lines: list[str] = []
    for part in parts:
        lines += ["AC P", "AN z", "AL GND", "AH UNL"]
        lines += [f"DP {angle(lat, 'NS')} {angle(lon, 'EW')}" for lon, lat in part[0]]
    file = folder / "z.openair"
    file.write_text("\n".join(lines), encoding="utf-8")
    return file


def ed269(folder: Path, parts: Sequence[Part]) -> Path:
    """ED-269."""
    volumes = [
        {"horizontalProjection": {"type": "Polygon", "coordinates": _closed(p)}, "uomDimensions": "M",
         "lowerLimit": 0, "lowerVerticalReference": "AGL"}
        for p in parts
    ]  # fmt: skip
    zone = {"identifier": "Z1", "country": "CHE", "name": "z", "type": "COMMON", "restriction": "PROHIBITED",
            "geometry": volumes}  # fmt: skip
    return _json(folder / "z.json", {"features": [zone]})


def ed318(folder: Path, parts: Sequence[Part]) -> Path:
    """ED-318."""
    properties = {"identifier": "Z1", "country": "CHE", "name": "z", "type": "PROHIBITED", "variant": "COMMON"}
    feature = {"type": "Feature", "properties": properties, "geometry": _polygons(parts)}
    return _json(folder / "z.json", {"type": "FeatureCollection", "features": [feature]})


def openaip(folder: Path, parts: Sequence[Part]) -> Path:
    """The answer of openAIP's service."""
    upper = {"value": 99999, "unit": 1, "referenceDatum": 1}
    one = {"_id": "1", "name": "z", "type": 3, "icaoClass": 8, "upperLimit": upper,
           "lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0}, "geometry": _polygons(parts)}  # fmt: skip
    return _json(folder / "z.json", {"items": [one]})


def geopackage(folder: Path, parts: Sequence[Part], crs: str = "EPSG:4326") -> Path:
    """A GeoPackage, by GDAL."""
    return _vector(folder / "z.gpkg", parts, crs)


def shapefile(folder: Path, parts: Sequence[Part], crs: str = "EPSG:4326") -> Path:
    """A Shapefile, by GDAL."""
    return _vector(folder / "z.shp", parts, crs)


def nad83(folder: Path, parts: Sequence[Part]) -> Path:
    """A GeoPackage whose degrees are of another datum (NAD83, the same within 2 m)."""
    return _vector(folder / "z.gpkg", parts, "EPSG:4269")


def mercator(folder: Path, parts: Sequence[Part]) -> Path:
    """A GeoPackage in metres of Web Mercator, whose level and upright edges are straight in degrees too."""
    return _vector(folder / "z.gpkg", parts, "EPSG:3857")


def _vector(file: Path, parts: Sequence[Part], crs: str) -> Path:
    import pyogrio
    import shapely

    def place(corners: Ring) -> list[tuple[float, float]]:
        if crs != "EPSG:3857":
            return list(corners)
        radius = 6_378_137.0
        return [(radius * np.radians(x), radius * np.log(np.tan(np.pi / 4 + np.radians(y) / 2))) for x, y in corners]

    shapes = [shapely.Polygon(place(p[0]), [place(h) for h in p[1:]]) for p in parts]
    whole = shapes[0] if len(shapes) == 1 else shapely.MultiPolygon(shapes)
    file.unlink(missing_ok=True)
    pyogrio.raw.write(
        file, shapely.to_wkb(np.array([whole], dtype=object)), [np.array(["z"], dtype=object)], ["name"],
        geometry_type=whole.geom_type, crs=crs,
    )  # fmt: skip
    return file


def _json(file: Path, content: Any) -> Path:
    file.write_text(json.dumps(content), encoding="utf-8")
    return file


WRITERS: dict[str, Callable[[Path, Sequence[Part]], Path]] = {
    "geojson": geojson, "kml": kml, "openair": openair, "ed269": ed269, "ed318": ed318, "openaip": openaip,
    "gpkg": geopackage, "shp": shapefile, "nad83": nad83, "mercator": mercator,
}  # fmt: skip
"""A writer for each format, by its name in tests."""

EITHER_EDGE = frozenset({"kml", "openair", "ed269"})
"""Formats without a statement that edges are straight in degrees: the area within great circles is inside, too."""
