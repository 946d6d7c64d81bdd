"""The content of a zone file, read strictly: a text, the values of JSON, or the members of a zip archive.

A text is UTF-8, or UTF-16 where its first bytes say so, as Windows programs save it. JSON has no key twice, no NaN and
no number without bounds. Of an archive, KMZ or a zipped Shapefile, one member is unpacked, never more than is allowed.

GeoJSON, ED-318 and openAIP's export share two statements: the coordinate system of their places, and whether a server
sent all of the features. Both are looked for in every JSON document, whatever its zones are.
"""

from __future__ import annotations

import codecs
import io
import json
import lzma
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.zones.attributes import is_number

UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def decoded(data: bytes) -> str:
    """The text, without a mark of its encoding. Raises UnicodeDecodeError."""
    return data.decode("utf-16" if data.startswith(UTF16) else "utf-8-sig")


def load_json(path: Path, data: bytes) -> Any:
    """The value that the text holds. Raises InputError."""
    try:
        return json.loads(decoded(data), object_pairs_hook=_unique, parse_constant=_no_constant, parse_int=_bounded_int)
    except RecursionError:
        raise InputError("the file is nested too deeply", where=str(path)) from None
    except ValueError as why:  # bad UTF-8, bad JSON, and the refusals below
        start = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
        hint = "; it looks like KML: name it .kml" if start.startswith(b"<") else ""
        raise InputError(f"this is not JSON: {str(why)[:200]}{hint}", where=str(path)) from None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    whole = dict(pairs)
    if len(whole) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {key[:60]!r} stands twice")
            seen.add(key)
    return whole


def _no_constant(name: str) -> Iterator[None]:
    raise ValueError(f"{name} is no number")


def _bounded_int(digits: str) -> float:
    # int() refuses thousands of digits with a message about its own limits; as inf the number is refused by gcsplan.
    return int(digits) if len(digits) <= 300 else math.inf


DAMAGED = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, RuntimeError, ValueError,
    LookupError, ArithmeticError,
)  # fmt: skip
"""The errors that the library raises for damaged archives."""

ENCRYPTED = 0x1
"""The flag of a member of a zip archive that has a password."""


def unpack(
    path: Path, data: bytes, kinds: Sequence[str], most_bytes: int, beside: Sequence[str] = ()
) -> dict[str, bytes]:
    """The one file of ``kinds`` (suffixes in lower case) in an archive, then those ``beside`` it, by their suffixes.

    Raises InputError if there is none or more than one, if they have more than ``most_bytes`` together, and if the
    archive is damaged or encrypted.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            # Programs of Apple add files ._NAME below __MACOSX, which are none of the user's.
            # A member's own name may be ./doc.kml or a//doc.kml, and one that ends with a slash is a folder.
            members = {PurePosixPath(m.filename): m for m in archive.infolist() if not m.is_dir()}
            names = [name for name in members if not name.name.startswith("._")]
            found = [n for n in names if n.suffix.lower() in kinds]
            if len(found) != 1:
                inside = ", ".join(str(n)[:60] for n in (found or names)[:6]) or "nothing"
                words = f"the archive must hold one {' or '.join(kinds)} file, given {inside}"
                cure = "; unpack it, and name each file in no_fly" if len(found) > 1 else ""
                raise InputError(words + cure, where=str(path))
            main = found[0]
            companions = [n for n in names if n.with_suffix("") == main.with_suffix("") and n.suffix.lower() in beside]
            unpacked: dict[str, bytes] = {}
            for name in dict.fromkeys([main, *companions]):
                if members[name].flag_bits & ENCRYPTED:
                    words = "is encrypted; unpack it with its password, and name the file in it"
                    raise InputError(words, where=f"{path}: {name}")
                with archive.open(members[name]) as member:
                    unpacked[name.suffix.lower()] = member.read(most_bytes + 1)
                # The archive's own sizes may be wrong, so the bytes themselves are counted.
                if sum(len(content) for content in unpacked.values()) > most_bytes:
                    words = f"unpacks to more than {most_bytes} bytes; simplify or split it"
                    raise InputError(words, where=f"{path}: {name}")
            return unpacked
    except DAMAGED as why:
        if isinstance(why, InputError):
            raise
        words = f"this is not a sound zip archive ({str(why)[:100]}); unpack it, and name the file in it"
        raise InputError(words, where=str(path)) from None


_DEGREES = re.compile(r"(?:^|[^A-Z0-9])(?:CRS:?84H?|4326(?:\+\d+)?|4979)[^A-Z0-9]*$", re.IGNORECASE)
"""The ends of the names, codes and addresses of WGS 84 in degrees."""


def require_wgs84(whole: Any, path: Path, format_name: str = "GeoJSON") -> None:
    """Raise InputError for another coordinate system than WGS 84, of the document or of any object in it.

    RFC 7946 removed ``crs`` from the draft of 2008, but files have it, and the draft allowed it in every object.
    """
    for where, crs in _stated(whole):
        if crs is not None and not _DEGREES.search(_name_of(crs)):
            raise InputError(
                f"{format_name} is in WGS84 degrees{' (RFC 7946)' if format_name == 'GeoJSON' else ''}, this file says "
                f"{json.dumps(crs)[:100]}; convert it with ogr2ogr -t_srs EPSG:4326",
                where=f"{path}: {where}crs",
            )


def _stated(whole: Any) -> Iterator[tuple[str, Any]]:
    """Each ``crs`` with the place of the object that it stands in: the document, features, geometries."""
    if not isinstance(whole, dict):
        return
    yield "", whole.get("crs")
    features = whole.get("features")
    for i, feature in enumerate(features if isinstance(features, list) else [whole]):
        if not isinstance(feature, dict):
            continue
        where = "" if feature is whole else f"features[{i}]."
        geometry = feature.get("geometry")
        yield where, feature.get("crs")
        if isinstance(geometry, dict):
            yield f"{where}geometry.", geometry.get("crs")
            inner = geometry.get("geometries")
            for k, one in enumerate(inner if isinstance(inner, list) else []):
                if isinstance(one, dict):
                    yield f"{where}geometry.geometries[{k}].", one.get("crs")


def _name_of(crs: Any) -> str:
    """The name, the code or the address of a coordinate system."""
    given = crs.get("properties", crs) if isinstance(crs, dict) else crs
    if isinstance(given, dict):
        given = next((given[key] for key in ("name", "code", "href") if key in given), given)
    return given if isinstance(given, str) else json.dumps(given)


def sent_in_part(whole: Any, path: Path) -> list[Mistake]:
    """The problem of what a server sent in part, since the zones of the rest would be missing; empty if it is whole."""
    if not isinstance(whole, dict):
        return []
    inner = whole.get("properties")
    given = {**inner, **whole} if isinstance(inner, dict) else whole
    matched: Any = given.get("numberMatched")
    returned: Any = given.get("numberReturned")
    if given.get("exceededTransferLimit") is True:
        words = "the server sent a part of the features alone (exceededTransferLimit); ask for all, page by page"
        return [Mistake(f"{path}: exceededTransferLimit", words)]
    if is_number(matched) and is_number(returned) and matched > returned:
        words = f"the server sent {returned} of {matched} features; ask for all, page by page"
        return [Mistake(f"{path}: numberMatched", words)]
    return []
