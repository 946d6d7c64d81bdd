"""Tables of rows as CSV and as Parquet. Every CSV that gcsplan writes is made here."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gcsplan.errors import InputError

PARQUET = "a Parquet table needs pyarrow, which is not installed: pip install 'gcsplan[parquet]'"


BY_SPREADSHEETS = ("=", "+", "-", "@", "\t", "\r", "\n")
"""First characters of texts that spreadsheets run as formulas."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def csv_of(rows: Iterable[Iterable[object]], end: str = "\n") -> str:
    """Rows of cells as CSV, None as an empty cell. Lines end with ``end``.

    A text that spreadsheets would run as a formula gets ``'`` in front, as they do it themselves; numbers stay.
    """
    lines = _Lines()
    # The library quotes what its own line end holds, so that a lone CR within a text parts no lines.
    csv.writer(lines, lineterminator="\r\n").writerows([_cell(value) for value in row] for row in rows)
    return "".join(line[:-2] + end for line in lines)


class _Lines(list[str]):
    """The lines that the library writes."""

    write = list[str].append


def _cell(value: object) -> object:
    if isinstance(value, str) and value.startswith(BY_SPREADSHEETS) and not _NUMBER.fullmatch(value):
        return f"'{value}"
    return value


def csv_text(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as CSV with a header; a value that a row lacks is empty. Numbers have all their digits."""
    return csv_of([columns, *([row.get(c) for c in columns] for row in rows)])


def parquet_bytes(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The rows as a Parquet file; the type of a column is that of its values. Raises InputError without pyarrow."""
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        raise InputError(PARQUET) from None
    table = arrow.table({c: [row.get(c) for row in rows] for c in columns})
    buffer = io.BytesIO()
    parquet.write_table(table, buffer)
    return buffer.getvalue()
