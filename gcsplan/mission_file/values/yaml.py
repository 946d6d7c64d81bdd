"""YAML as its authors mean it: the core schema of YAML 1.2, no tags, no duplicate keys, everything bounded.

PyYAML alone reads ``5.0e6`` as text, ``no`` as False and ``12:30`` as 750, silently lets a key overwrite its duplicate,
and can be made to use all memory by a few lines of aliases.

`cure` is for a slip of the pen: what the line looks like, and what it should be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

import yaml

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.values.places import PLACE_EXAMPLES

MAX_YAML_BYTES = 5_000_000
MAX_YAML_DEPTH = 40
MAX_ALIASES = 200
MAX_YAML_NODES = 500_000
"""Most values, with every alias expanded."""

_TOO_DEEP = f"the file is nested more than {MAX_YAML_DEPTH} levels deep"

_TAG = "tag:yaml.org,2002:"
_PLAIN_STYLE = "plain"
_NULL = re.compile(r"(?:~|null|Null|NULL|)\Z")
_BOOL = re.compile(r"(?:true|True|TRUE|false|False|FALSE)\Z")
_INT = re.compile(r"(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)\Z")
_YAML_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z")
_SPECIAL = re.compile(r"(?:[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z")

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class Loader(_Base):  # type: ignore[misc]
    """Marks plain scalars with a tag of their own, so that `_scalar` decides their type."""

    def resolve(self, kind: type[yaml.Node], value: str, implicit: Any) -> str:
        if kind is yaml.ScalarNode:
            return _PLAIN_STYLE if implicit[0] else _TAG + "str"
        return _TAG + ("seq" if kind is yaml.SequenceNode else "map")


def read_yaml(text: str, *, where: str) -> Any:
    """The single document in ``text``: dicts with text keys, lists, str, int, float, bool, None.

    Raises InputError, with line and column, for text that is not YAML, for tags, duplicate keys, and for text beyond
    the bounds of this module.
    """
    if len(text) > MAX_YAML_BYTES:
        raise InputError(
            f"the file has {len(text)} characters, more than {MAX_YAML_BYTES // 10**6} million", where=where
        )
    try:
        _measure(text, where)
        node = yaml.compose(text, Loader=Loader)
        if node is None:
            raise InputError(
                "the file is empty: a mission has at least version, terrain, limits, vehicles", where=where
            )
        _count(node, {}, where)
        return _value(node, where)
    except yaml.MarkedYAMLError as why:
        mark = why.problem_mark or why.context_mark
        context = why.context
        if context and why.context_mark is not None and mark is not why.context_mark:
            context += f" (begun in line {why.context_mark.line + 1})"
        problem = " ".join(x for x in (context, why.problem) if x)
        if "nesting depth" in problem:  # since PyYAML 6.0.4 its scanner, which reads ahead, has a limit of its own
            raise _wrong(_TOO_DEEP, where, mark) from None
        begun = None if why.context_mark is None else why.context_mark.line
        hint = "" if mark is None else cure(text, mark.line, begun)
        raise _wrong(f"this is not YAML: {problem}{hint}", where, mark) from None
    except (yaml.YAMLError, UnicodeError) as why:
        raise InputError(f"this is not YAML: {str(why).splitlines()[0][:200]}", where=where) from None


def lines_of(text: str, paths: Iterable[str]) -> list[int | None]:
    """The line, from 1, of each key such as ``vehicles[0].start`` in a document that `read_yaml` has read.

    That of the nearest section around it if the key is not there; None if not even its first key is.
    """
    root = yaml.compose(text, Loader=Loader)
    known: dict[int, dict[str, tuple[yaml.Node, yaml.Node]]] = {}
    return [_line_of(root, path, known) for path in paths]


def _line_of(node: yaml.Node | None, path: str, known: dict[int, dict[str, tuple[yaml.Node, yaml.Node]]]) -> int | None:
    """``known``: the keys of the mappings that were looked into, by their ids."""
    line = None
    for key, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", path):
        if isinstance(node, yaml.MappingNode) and key:
            if id(node) not in known:
                known[id(node)] = {k.value: (k, v) for k, v in reversed(node.value) if isinstance(k, yaml.ScalarNode)}
            inner = known[id(node)].get(key)
            if inner is None:
                return line
            line, node = inner[0].start_mark.line + 1, inner[1]
        elif isinstance(node, yaml.SequenceNode) and index and int(index) < len(node.value):
            node = node.value[int(index)]
            line = node.start_mark.line + 1
        else:
            return line
    return line


def _measure(text: str, where: str) -> None:
    """Refuse oversized text by its stream of events, since composing it first could recurse without end."""
    depth = nodes = aliases = 0
    for event in yaml.parse(text, Loader=Loader):
        nodes += isinstance(event, yaml.NodeEvent)
        aliases += isinstance(event, yaml.AliasEvent)
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_YAML_DEPTH:
            raise _wrong(_TOO_DEEP, where, event.start_mark)
        for what, count, most in (("aliases", aliases, MAX_ALIASES), ("values", nodes, MAX_YAML_NODES)):
            if count > most:
                raise _wrong(f"the file has more than {most} {what}", where, event.start_mark)


def _count(node: yaml.Node, sizes: dict[int, int], where: str) -> int:
    """The number of values below ``node`` with every alias expanded; refuses loops and more than `MAX_YAML_NODES`."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    known = sizes.get(id(node))
    if known is not None:
        if known < 0:
            raise _wrong("an alias holds itself", where, node.start_mark)
        return known
    sizes[id(node)] = -1
    children = node.value if isinstance(node, yaml.SequenceNode) else [x for pair in node.value for x in pair]
    total = 1 + sum(_count(child, sizes, where) for child in children)
    if total > MAX_YAML_NODES:
        raise InputError(f"with its aliases followed the file has more than {MAX_YAML_NODES} values", where=where)
    sizes[id(node)] = total
    return total


def _value(node: yaml.Node, where: str) -> Any:
    if isinstance(node, yaml.SequenceNode):
        _require_tag(node, "seq", where)
        return [_value(child, where) for child in node.value]
    if isinstance(node, yaml.MappingNode):
        _require_tag(node, "map", where)
        return _mapping(node, where)
    return _scalar(node, where)


def _mapping(node: yaml.MappingNode, where: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    merged: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = _scalar(key_node, where) if isinstance(key_node, yaml.ScalarNode) else None
        if not isinstance(key, str):
            number = isinstance(key, int | float) and not isinstance(key, bool)
            hint = (
                f"; decimals begin with a point, and a place within braces has brackets: `[{PLACE_EXAMPLES[0]}]`"
                if number
                else ""
            )
            raise _wrong(f"a key must be a word, given {_shown(key_node)}{hint}", where, key_node.start_mark)
        if key == "<<" and key_node.tag == _PLAIN_STYLE:
            for part in value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]:
                if not isinstance(part, yaml.MappingNode):
                    raise _wrong("`<<` merges mappings only", where, part.start_mark)
                for k, v in _mapping(part, where).items():
                    merged.setdefault(k, v)
            continue
        if key in found:
            raise _wrong(f"the key `{key}` stands twice; keep one", where, key_node.start_mark)
        tight = missing_space(key) if value_node.tag == _PLAIN_STYLE and not value_node.value else ""
        if tight:  # `{sysid:1}` is a mapping with the key `sysid:1`
            raise _wrong(tight, where, key_node.start_mark)
        found[key] = _value(value_node, where)
    return merged | found


def _scalar(node: yaml.Node, where: str) -> Any:
    text = node.value
    if node.tag != _PLAIN_STYLE:  # quoted, a block of text, or with an explicit tag
        _require_tag(node, "str", where)
        return text
    if _NULL.match(text):
        return None
    if _BOOL.match(text):
        return text[0] in "tT"
    if _INT.match(text):
        if len(text) > 4000:  # Python's int() has a limit slightly above
            raise _wrong(f"a number of {len(text)} digits", where, node.start_mark)
        base = {"0o": 8, "0x": 16}.get(text[:2], 10)
        return int(text, base)
    if _YAML_FLOAT.match(text):
        return float(text)
    if _SPECIAL.match(text):
        return math.nan if "n" in text.lower().replace("inf", "") else math.copysign(math.inf, -1 if "-" in text else 1)
    return text


def number_or_text(text: str) -> float | str:
    """A number in the form that this reader takes for one and YAML 1.1 for text, such as ``6.5e6``; else ``text``."""
    is_number = len(text) < 40 and ("e" in text or "E" in text) and _YAML_FLOAT.match(text)
    return float(text) if is_number else text


def _require_tag(node: yaml.Node, kind: str, where: str) -> None:
    if node.tag not in (_TAG + kind, "!"):
        raise _wrong(f"the tag {node.tag[:80]!r} is not allowed here; write the plain value", where, node.start_mark)


def _wrong(message: str, where: str, mark: Any) -> InputError:
    """The mistake at a mark of the text; None: somewhere in it."""
    if mark is None:
        return InputError(message, where=where)
    at = f"{where}: line {mark.line + 1}, column {mark.column + 1}"
    return InputError(message, where=at, problems=[Mistake(at, message, in_line=mark.line + 1)])


def _shown(node: yaml.Node) -> str:
    return repr(node.value)[:60] if isinstance(node, yaml.ScalarNode) else "a list or a mapping"


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
    """The cure for text such as ``sysid:1`` in place of a key and its value, or an empty text."""
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
    """The fault in the indent of a key after another key, or an empty text."""
    above, own = _KEY_LINE.fullmatch(before), _KEY_LINE.fullmatch(line)
    if above is None or own is None or len(above[1]) == len(own[1]) or "-" in own[1]:
        return ""
    columns = f"in column {len(own[1]) + 1}, the key above it in column {len(above[1]) + 1}"
    return f"`{own[2]}` begins {columns}: let both begin alike"


def _of_line(line: str, *, own: bool) -> str:
    """The fault in a line; ``own`` if the parser stopped in it."""
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
