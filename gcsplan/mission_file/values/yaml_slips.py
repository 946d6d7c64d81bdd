"""The cure for a slip of the pen in YAML: what the line looks like, and what it should be."""

from __future__ import annotations

import re

MOST_CHARACTERS_SHOWN = 60
"""Characters of a line that a cure repeats."""

_TIGHT = re.compile(r"(\s*(?:-\s+)?)([A-Za-z_]\w*):(?![\s/])(.+)")
_TIGHT_DASH = re.compile(r"(\s*)-([A-Za-z_]\w*:(?:\s.*)?)")
_COLON_IN_VALUE = re.compile(r"\s*(?:-\s+)?([A-Za-z_]\w*):\s+([^\"'\[{|>#&*!].*:(?:\s.*)?)")
_QUOTED = re.compile(r"""\s*(?:-\s+)?([A-Za-z_]\w*):\s+(["'])(.*)""")
_JOINED = re.compile(r"[^\s,]\s+([A-Za-z_]\w*):\s")
_NO_COLON = re.compile(r"\s*(?:-\s+)?([A-Za-z_]\w*)\s+([^\s:#][^:#]*)")
_KEY_LINE = re.compile(r"(\s*(?:-\s+)?)([A-Za-z_]\w*):(?:\s.*)?")
_RESERVED_BEGINNING = re.compile(r"\s*(?:-\s+)?([A-Za-z_]\w*):\s+([@`%].*)")


def cure(text: str, line: int, begun: int | None) -> str:
    """``; line N: …`` for the line of a YAML error (from 0), or an empty text if its shape is not known.

    ``begun`` is the line where the parser began what it could not finish: a value without a space after its colon is
    noticed one line later only.
    """
    lines = text.splitlines()
    before = next((k for k in range(min(line, len(lines)) - 1, -1, -1) if lines[k].strip()), None)
    for number in dict.fromkeys(k for k in (line, begun, before) if k is not None):
        if number < len(lines):
            found = _of_line(lines[number], own=number == line)
            if found:
                return f"; line {number + 1}: {found}"
    stopped = line >= len(lines) or _KEY_LINE.fullmatch(lines[line])
    if begun is not None and stopped and (found := _not_closed(lines[begun : begun + 1])):
        return f"; line {begun + 1}: {found}"
    if begun is not None and line > begun and begun < len(lines) and (match := _NO_COLON.fullmatch(lines[begun])):
        return f"; line {begun + 1}: a colon is missing after the key: `{match[1]}: {_short(match[2].strip())}`"
    if before is not None and line < len(lines) and (found := _indented(lines[before], lines[line])):
        return f"; line {line + 1}: {found}"
    return ""


def missing_space(text: str) -> str:
    """The cure for text such as ``sysid:1`` where a key and its value are wanted, or an empty text."""
    match = _TIGHT.fullmatch(text)
    return f"a space is missing after the colon: `{match[2]}: {_short(match[3].strip())}`" if match else ""


def _not_closed(lines: list[str]) -> str:
    """Which bracket or brace of a line has no end, without regard to those within quotes."""
    for line in lines:
        plain = re.sub(r"\"[^\"]*\"|'[^']*'", "", line)
        for opening, closing in ("[]", "{}"):
            if plain.count(opening) > plain.count(closing):
                return f"a closing {closing} is missing: `{_short(line.strip())}{closing}`"
    return ""


def _indented(before: str, line: str) -> str:
    """What is wrong with the indent of a key after another key, or an empty text."""
    above, own = _KEY_LINE.fullmatch(before), _KEY_LINE.fullmatch(line)
    if above is None or own is None or len(above[1]) == len(own[1]) or "-" in own[1]:
        return ""
    columns = f"in column {len(own[1]) + 1}, the key above it in column {len(above[1]) + 1}"
    return f"`{own[2]}` begins {columns}: let both begin alike"


def _of_line(line: str, *, own: bool) -> str:
    """What is wrong with a line; ``own`` if the parser stopped in it."""
    if "\t" in line[: len(line) - len(line.lstrip())]:
        return "indent with spaces, not tabs"
    if "\u00a0" in line:
        return "a no-break space is no space in YAML; type the space anew"
    if own and (match := _COLON_IN_VALUE.fullmatch(line)):
        joined = _JOINED.search(match[2])
        other = f"; or `{joined[1]}:` begins a line of its own" if joined else ""
        return f"a colon within a text needs quotes: `{match[1]}: {_in_quotes(match[2])}`{other}"
    if own and (match := _QUOTED.fullmatch(line)) and (inner := _inner_quotes(match[2], match[3])):
        return f"a text that has quotes in it is written without quotes around it: `{match[1]}: {_short(inner)}`"
    if own and (match := _RESERVED_BEGINNING.fullmatch(line)):
        return f"a text that begins with {match[2][0]} needs quotes: `{match[1]}: {_in_quotes(match[2])}`"
    if match := _TIGHT_DASH.fullmatch(line):
        return f"a space is missing after the dash: `- {_short(match[2])}`"
    return missing_space(line)


def _inner_quotes(mark: str, rest: str) -> str:
    """The text between the outer quotes, if the quote mark stands within it, too, and it may do without them."""
    inner, last = rest.rstrip()[:-1], rest.rstrip()[-1:]
    plain = (
        last == mark and inner and inner[0] not in "\"'[]{}&*!|>%@`#-?:, " and ": " not in inner and " #" not in inner
    )
    return inner if mark in inner and plain and "\\" not in inner else ""


def _in_quotes(text: str) -> str:
    """A text in the quotes that it does not have itself."""
    value = text.strip()
    if '"' in value or "\\" in value:
        return "'" + _short(value.replace("'", "''")) + "'"
    return f'"{_short(value)}"'


def _short(text: str) -> str:
    return text if len(text) <= MOST_CHARACTERS_SHOWN else text[:MOST_CHARACTERS_SHOWN] + "…"
