"""The content of a zone file, read strictly: a text, the values of JSON, or the members of a zip archive.

A text is UTF-8, or UTF-16 where its first bytes say so, as Windows programs save it. JSON has no key twice, no NaN and
no number without bounds. Of an archive, KMZ or a zipped Shapefile, one member is unpacked, never more than is allowed.
"""

from __future__ import annotations

import codecs
import io
import json
import lzma
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from gcsplan.errors import InputError

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
