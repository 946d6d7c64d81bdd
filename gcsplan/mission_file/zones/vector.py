"""Zones from GeoPackage, Shapefile and FlatGeobuf, in any coordinate system, by GDAL through pyogrio."""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.attributes import Attribute, ZoneStatements, as_figure, read_attributes
from gcsplan.mission_file.zones.contents import unpack
from gcsplan.mission_file.zones.draft import MAX_VERTICES, SIZE_KEYS
from gcsplan.mission_file.zones.file import EMPTY_CURE, MAX_ZONES, Drawn, ZoneFile, drawn_unread
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import beyond_outline
from gcsplan.world.geodesy.reprojection import ToDegrees
from gcsplan.world.terrain.input_files import tell_file

if TYPE_CHECKING:
    import shapely

BEGINNINGS = {".gpkg": b"SQLite format 3\0", ".shp": b"\x00\x00\x27\x0a", ".fgb": b"fgb\x03"}
"""How files of each kind begin: GDAL goes by the content, and would follow some contents to other files."""

ARC_STEP_DEG = "0.1"
"""GDAL draws arcs as chords of this angle: at a radius of 50 km they lie 2 cm inside."""

HOT_JOURNAL = bytes.fromhex("d9d505f920a163d7")
"""The first bytes of an SQLite journal of unfinished changes: without the journal the file holds half of them."""

MOST_WARNINGS = 5

COMPANIONS = (".shx", ".dbf", ".prj", ".cpg")
NEEDED_COMPANIONS = (".shx", ".dbf", ".prj")

NO_CRS = (
    "has no coordinate system, so that its places are not known; set the true one (in QGIS Layer > Set CRS, then "
    "export; or ogr2ogr -a_srs EPSG:CODE)"
)


def read_vector(path: Path, data: bytes, *, layer: str | None, most_bytes: int) -> ZoneFile:
    """The zones of every layer, or of the one called ``layer``. ``data`` is the file's content. Raises InputError."""
    try:
        import pyogrio
    except ImportError:
        words = f"{path.suffix} files are read by pyogrio, which is not there: pip install 'gcsplan[gis]'"
        raise InputError(words, where=str(path)) from None
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": ARC_STEP_DEG})
    found = ZoneFile(path)
    with _on_disk(path, data, most_bytes) as source, warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            layers = [(str(name), kind) for name, kind in pyogrio.list_layers(source)]
            for name in _chosen_layers(path, layers, layer):
                _layer(found, pyogrio, source, name)
        except (RuntimeError, ValueError, OSError) as why:
            if isinstance(why, InputError):
                raise
            reason = str(why).replace(str(source), path.name)[:200]
            raise InputError(f"GDAL cannot read it: {reason}", where=str(path)) from None
    found.own_notes += dict.fromkeys(Note("gdal_warns", warning=str(w.message)[:200]) for w in heard[:MOST_WARNINGS])
    return found


@contextmanager
def _on_disk(path: Path, data: bytes, most_bytes: int) -> Iterator[Path]:
    """A folder's copy of the file and its companions, none of which can change or grow any more."""
    kind = path.suffix.lower()
    if kind == ".zip":
        parts = unpack(path, data, tuple(BEGINNINGS), most_bytes, COMPANIONS)
        kind = next(iter(parts))
    else:
        parts = {kind: data, **(_beside(path, most_bytes - len(data)) if kind == ".shp" else {})}
    if kind == ".gpkg":
        _require_settled(path)
    if not parts[kind].startswith(BEGINNINGS[kind]):
        raise InputError(f"this is not a {kind} file; its content is of another kind", where=str(path))
    if kind == ".shp" and (missing := [part for part in NEEDED_COMPANIONS if part not in parts]):
        names = " and ".join(f"{path.stem}{part}" for part in missing)
        why = " (.prj is its coordinate system)" if ".prj" in missing else ""
        raise InputError(f"{names} must be beside it{why}: copy all files of the Shapefile", where=str(path))
    with tempfile.TemporaryDirectory(prefix="gcsplan-") as folder:
        for suffix, content in parts.items():
            (Path(folder) / f"zones{suffix}").write_bytes(content)
        yield Path(folder) / f"zones{kind}"


def _require_settled(path: Path) -> None:
    """Raise InputError if SQLite has changes of a GeoPackage, or what would undo them, in a file beside it."""
    unsaved, undo = (path.with_name(path.name + end) for end in ("-wal", "-journal"))
    tell_file(unsaved)
    tell_file(undo)
    if unsaved.is_file() and unsaved.stat().st_size:
        words = f"{unsaved.name} beside it holds changes that are not in it yet; close the program that has it open"
        raise InputError(words, where=str(path))
    if undo.is_file():
        with undo.open("rb") as file:
            hot = file.read(len(HOT_JOURNAL)) == HOT_JOURNAL
        if hot:
            words = (
                f"{undo.name} beside it belongs to changes that were begun and not ended; close the program that has "
                "it open, or open and close it once"
            )
            raise InputError(words, where=str(path))


def _beside(path: Path, most_bytes: int) -> dict[str, bytes]:
    """The companions of a Shapefile, by their suffixes."""
    beside: dict[str, bytes] = {}
    for suffix in COMPANIONS:
        names = (path.with_suffix(suffix), path.with_suffix(suffix.upper()))
        for name in names:
            tell_file(name)
        file = next((f for f in names if f.is_file()), None)
        if file is None:
            continue
        most_bytes -= file.stat().st_size
        if most_bytes < 0:
            raise InputError("the files of this Shapefile are too large; simplify or split it", where=str(path))
        beside[suffix] = file.read_bytes()
    return beside


def _chosen_layers(path: Path, layers: list[tuple[str, Any]], layer: str | None) -> list[str]:
    """The names of the layers to read: every layer with shapes, or the ``layer`` that is given."""
    drawn = [name for name, kind in layers if kind is not None]
    if layer is not None and layer not in drawn:
        raise InputError(
            f"has no layer {layer[:60]!r} with shapes; it has {', '.join(drawn) or 'none'}", where=str(path)
        )
    if not drawn:
        raise InputError("holds no layer with shapes", where=str(path))
    return drawn if layer is None else [layer]


def _layer(found: ZoneFile, pyogrio: Any, source: Path, layer: str) -> None:
    import shapely

    where = f"{found.path}: {layer}" if source.suffix == ".gpkg" else str(found.path)
    stated = pyogrio.read_info(source, layer=layer)
    meta, fids, shapes, columns = pyogrio.raw.read(
        source, layer=layer, max_features=MAX_ZONES + 1, return_fids=True, datetime_as_string=True
    )
    if len(shapes) > MAX_ZONES:
        raise InputError(f"the file has more than {MAX_ZONES} zones", where=where)
    if stated["features"] not in (-1, len(shapes)):
        raise InputError(
            f"{len(shapes)} of {stated['features']} features can be read; the file is damaged", where=where
        )
    geometries = _geometries(shapes, where)
    extent = shapely.total_bounds(geometries)
    if not np.isfinite(extent).all():
        extent = np.zeros(4)  # no shape at all: every feature is refused below
    if not meta["crs"]:
        raise InputError(NO_CRS, where=where)
    to_degrees = ToDegrees(meta["crs"], (0.5 * (extent[0] + extent[2]), 0.5 * (extent[1] + extent[3])), where=where)
    if to_degrees.note:
        found.own_notes.append(to_degrees.note)
    names = [str(name) for name in meta["fields"]]
    for i, (fid, geometry) in enumerate(zip(fids, geometries, strict=True)):
        at = f"{where}: feature {fid}"
        given = _attributes({name: column[i] for name, column in zip(names, columns, strict=True)}, at)
        stated = read_attributes(given, at, f"{found.path.stem}[{fid}]", found.problems)
        if stated is not None:
            _feature(found, geometry, stated, at, to_degrees)


def _geometries(shapes: Any, where: str) -> Any:
    """The features' geometries. Raises InputError for one that is none, such as a ring that is not closed."""
    import shapely

    try:
        return shapely.from_wkb(shapes)
    except shapely.errors.ShapelyError as why:
        raise InputError(
            f"a geometry cannot be read ({str(why)[:120]}); repair it (in QGIS, Fix geometries)", where=where
        ) from None


def _attributes(row: Mapping[str, Any], where: str) -> list[Attribute]:
    given = []
    for key, value in row.items():
        plain = value.item() if isinstance(value, np.generic) else value
        if isinstance(plain, float) and math.isnan(plain):
            plain = None
        if isinstance(plain, str) and key.lower() in SIZE_KEYS:
            plain = as_figure(plain)
        given.append(Attribute(key, plain, f"{where}.{key[:80]}"))
    return given


def _feature(
    found: ZoneFile, geometry: shapely.Geometry | None, stated: ZoneStatements, where: str, to_degrees: ToDegrees
) -> None:
    """Add every part of a feature's geometry."""
    parts = [] if geometry is None else _parts(geometry)
    if not parts:
        found.unshaped.append(("empty", stated.name, Mistake(where, f"the feature has no geometry; {EMPTY_CURE}")))
    for i, shape in enumerate(parts):
        part = stated.name if len(parts) == 1 else f"{stated.name}/{i + 1}"
        if shape.geom_type not in ("Polygon", "Point", "LineString"):
            found.problems.append(Mistake(where, f"must be polygons, points or lines, given a {shape.geom_type}"))
            continue
        outline = shape.exterior if shape.geom_type == "Polygon" else shape
        drawn = _unread(outline)
        xy = np.asarray(outline.coords)[:, :2]
        try:
            is_keep_in = shape.geom_type == "Polygon" and bool(shape.interiors)  # if it is wide, and then by that name
            rings = [np.asarray(ring.coords)[:, :2] for ring in getattr(shape, "interiors", ())]
            corners, *holes = (
                [(float(lat), float(lon)) for lat, lon in to_degrees.line(ring, MAX_VERTICES, any_width=is_keep_in)]
                for ring in (xy, *rings)
            )
        except InputError as why:
            found.problems.append(Mistake(where, f"zone {stated.name[:60]!r}: {why.message}"))
            continue
        if odd := beyond_outline(xy.tolist(), [ring.tolist() for ring in rings], metres=True):
            found.problems.append(Mistake(where, f"zone {stated.name[:60]!r}: {odd}"))
        elif shape.geom_type == "Polygon":
            found.add_ring(stated, part, where, corners, "", drawn, holes)
        elif shape.geom_type == "Point":
            found.add_circle(stated, part, where, corners[0], drawn.remarks)
        else:
            found.add_line(stated, part, where, corners, "", drawn.remarks)


def _parts(geometry: shapely.Geometry) -> list[Any]:
    """The single shapes of a geometry that may hold several, or collections of several, without recursion."""
    stack, parts = [geometry], []
    while stack:
        one = stack.pop()
        inner = getattr(one, "geoms", None)
        if inner is not None:
            stack += reversed(list(inner))
        elif not one.is_empty:
            parts.append(one)
    return parts


def _unread(line: Any) -> Drawn:
    """A remark on altitudes in corners, which limit nothing."""
    heights = [p[2] for p in line.coords if len(p) > 2 and math.isfinite(p[2]) and p[2] != 0.0] if line.has_z else []
    return drawn_unread(heights)
