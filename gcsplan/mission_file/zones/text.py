"""The text of a zone file: UTF-8, or UTF-16 where its first bytes say so, as Windows programs save it."""

from __future__ import annotations

import codecs

UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def decoded(data: bytes) -> str:
    """The text, without a mark of its encoding. Raises UnicodeDecodeError."""
    return data.decode("utf-16" if data.startswith(UTF16) else "utf-8-sig")
