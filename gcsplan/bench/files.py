"""The files that benchmarks write and keep: whole files in a directory, pictures, and rows as JSON lines."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcsplan.errors import InputError
from gcsplan.export.outdir import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def ready(out: Path) -> None:
    """Create the directory, before a long run. Raises InputError if that fails."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made: {error.strerror or error}", where=str(out)) from error


def write_all(out: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write files, by name, to a directory that is created if missing; each is written whole or not at all.

    Returns their paths. Raises InputError if one cannot be written.
    """
    ready(out)
    for name, content in contents.items():
        write_whole(out / name, content)
    return [out / name for name in contents]


def png(figure: Figure, dpi: float = 100.0) -> bytes:
    """The figure as PNG, the same bytes each time."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi, metadata={"Software": None})
    return out.getvalue()


def kept_rows(path: Path) -> Iterator[Any]:
    """The records of a file of JSON lines; none if there is no such file.

    A line that cannot be read, such as a truncated last one, counts as not written. Raises InputError if the file
    cannot be read.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=str(path)) from error
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        yield row
