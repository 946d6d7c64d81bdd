"""A changed document written into the YAML text that it was read from: only the changed values are touched.

The places of values come from PyYAML's nodes. Comments, order, quotes and line ends of all else stay as they are, which
no writer of whole documents keeps. Whoever calls reads the new text again, and compares: nothing here has to be right
for every text, as long as a mistake is seen.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import yaml

from gcsplan.mission_file.values.yaml import Loader, read_yaml

RESERVED_WORDS = {"yes", "no", "on", "off", "true", "false", "null"}

Splice = tuple[int, int, str]
"""Begin and end in the text, and what stands there instead."""


def flow(value: Any) -> str:
    """A value of YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(flow, value))}]"
    if isinstance(value, str):
        return word(value)
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' if value < 0 else ''}.inf"
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


def word(text: str) -> str:
    """A text as a YAML value, in quotes unless it cannot be taken for anything else."""
    plain = re.fullmatch(r"[A-Za-z/][A-Za-z0-9_./:-]*[A-Za-z0-9_]", text) and text.lower() not in RESERVED_WORDS
    return text if plain else json.dumps(text, ensure_ascii=False)


def with_document(text: str, new: Mapping[str, Any]) -> str | None:
    """``text`` with the values of ``new`` where they differ from its own; None where one has no place of its own."""
    root = yaml.compose(text, Loader=Loader)
    writing = _Writing(text)
    if not isinstance(root, yaml.MappingNode) or not writing.mapping(root, read_yaml(text, where=""), new):
        return None
    # From the end to the beginning; of two at one place the inner one, which is found first, comes to stand first.
    later_first = writing.spans[::-1]
    for begin, end, put in sorted(later_first, key=lambda span: span[:2], reverse=True):
        text = text[:begin] + put + text[end:]
    return text


class _Writing:
    """The spans of a text that change. Each method is False where a change has no place."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.spans: list[Splice] = []
        self.line_end = "\r\n" if "\r\n" in text else "\n"

    def mapping(self, node: yaml.MappingNode, old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
        own = {key.value: (key, value) for key, value in node.value}
        gone = [key for key in own if key in old and key not in new]
        more = [key for key in new if key not in own and (key not in old or old[key] != new[key])]
        if any(key not in own for key in old if key not in new):
            return False  # a merged key cannot go
        if len(gone) > len(more) and (node.flow_style or len(gone) == len(own)):
            return False
        if not all(self._remove(own[was]) for was in gone[len(more) :]):
            return False
        for was, key in zip(gone, more, strict=False):  # a key in another unit
            name, value = own[was]
            self.spans.append((name.start_mark.index, _end(value), f"{key}: {flow(new[key])}"))
        for key, (name, value) in own.items():
            if key in new and old.get(key) != new[key] and not self._value(name, value, old.get(key), new[key]):
                return False
        added = more[len(gone) :]
        if not added:
            return True
        if node.flow_style:
            self._into_flow(node, [f"{key}: {flow(new[key])}" for key in added], own)
        else:
            column = node.value[0][0].start_mark.column
            self._below(node, [line for key in added for line in _lines(key, new[key], " " * column)], column)
        return True

    def _value(self, name: yaml.Node, node: yaml.Node, old: Any, new: Any) -> bool:
        """The value of the key ``name`` changes from ``old`` to ``new``."""
        if isinstance(node, yaml.MappingNode) and isinstance(old, dict) and isinstance(new, dict) and node.value:
            return self.mapping(node, old, new)
        lists = isinstance(old, list) and isinstance(new, list)
        if isinstance(node, yaml.SequenceNode) and lists and (order := _order(old, new)):
            return self._reordered(node, order)
        if isinstance(node, yaml.SequenceNode) and lists and not node.flow_style:
            mark = len(self.spans)
            if self._entries(node, old, new):
                return True
            del self.spans[mark:]
        if (
            isinstance(node, yaml.SequenceNode) and lists
            and 0 < len(old) <= len(new) and all(_alike(a, b) for a, b in zip(old, new, strict=False))
        ):  # fmt: skip
            return self._sequence(node, old, new)
        if (isinstance(node, yaml.ScalarNode) and node.value) or getattr(node, "flow_style", False):
            self.spans.append((node.start_mark.index, _end(node), flow(new)))
            return True
        colon = self.text.find(":", name.end_mark.index)
        self.spans.append((colon + 1, max(colon + 1, _end(node)), f" {flow(new)}"))
        return colon >= 0

    def _sequence(self, node: yaml.SequenceNode, old: list[Any], new: list[Any]) -> bool:
        for inner, was, now in zip(node.value, old, new, strict=False):
            if was != now and not self.mapping(inner, was, now):
                return False
        added = new[len(old) :]
        if added and node.flow_style:
            self._into_flow(node, [flow(value) for value in added], node.value)
        elif added:
            column = node.start_mark.column
            self._below(node, [f"{' ' * column}- {flow(value)}" for value in added], column)
        return True

    def _entries(self, node: yaml.SequenceNode, old: list[Any], new: list[Any]) -> bool:
        """A block list: entries that go take their lines along, and new ones come behind those that stay."""
        stays = _staying(old, new)
        if not stays:
            return False
        for k, (inner, was) in enumerate(zip(node.value, old, strict=True)):
            mark = len(self.spans)
            now = new[stays[k]] if k in stays else was
            if k not in stays and not self._remove(inner):
                return False
            if now != was and not (isinstance(inner, yaml.MappingNode) and self.mapping(inner, was, now)):
                self.spans[mark:] = [(inner.start_mark.index, _end(inner), flow(now))]
        added = new[len(stays) :]
        if added:
            lines = [f"{' ' * node.start_mark.column}- {flow(value)}" for value in added]
            self._below(node.value[max(stays)], lines, node.start_mark.column)
        return True

    def _reordered(self, node: yaml.SequenceNode, order: list[int]) -> bool:
        """A list in another order: each entry takes its text along, in a block its lines with the comments above and
        below it that are its own."""
        if node.flow_style:
            own = [(inner.start_mark.index, _end(inner)) for inner in node.value]
        else:
            own = [self._lines_of(inner, node.start_mark.column) for inner in node.value]
        texts = [self.text[begin:end] for begin, end in own]
        self.spans += [(begin, end, texts[k]) for (begin, end), k in zip(own, order, strict=True)]
        return node.flow_style or all(text.lstrip()[:1] in ("-", "#") for text in texts)

    def _lines_of(self, entry: yaml.Node, column: int) -> tuple[int, int]:
        """The lines of an entry of a block whose dash is at a column, without the last line end."""
        begin = self.text.rfind("\n", 0, entry.start_mark.index) + 1
        above = re.compile(rf" {{{column}}}#[^\n]*\n")
        while begin and above.fullmatch(self.text, before := self.text.rfind("\n", 0, begin - 1) + 1, begin):
            begin = before
        return begin, self._behind(entry, column)

    def _into_flow(self, node: yaml.CollectionNode, parts: list[str], own: Any) -> None:
        """Behind the last member, or between the brackets of an empty collection."""
        at = _end(node.value[-1]) if own else node.end_mark.index - 1
        self.spans.append((at, at, (", " if own else "") + ", ".join(parts)))

    def _remove(self, member: Any) -> bool:
        """Take out the lines of a member of a block, from that of its key or dash on; a comment above them stays."""
        name = member[0] if isinstance(member, tuple) else member
        begin = self.text.rfind("\n", 0, name.start_mark.index) + 1
        stop = self.text.find("\n", max(_end(member) - 1, begin))
        self.spans.append((begin, len(self.text) if stop < 0 else stop + 1, ""))
        before = self.text[begin : name.start_mark.index].strip()
        return before == ("" if isinstance(member, tuple) else "-")

    def _below(self, node: yaml.Node, lines: list[str], column: int) -> None:
        """In lines of their own, which begin at a column, behind the lines of a value."""
        stop = self._behind(node, column)
        self.spans.append((stop, stop, "".join(self.line_end + line for line in lines)))

    def _behind(self, node: yaml.Node, column: int) -> int:
        """The end of the line in which a value ends, or of the comments below it that are farther in: its own."""
        end = _end(node)
        if self.text[end - 1 : end] == "\n":  # behind a block of text
            end -= 1
        stop = self.text.find("\n", end)
        stop = len(self.text) if stop < 0 else stop - self.text[:stop].endswith("\r")
        own = re.compile(rf"\r?\n {{{column + 1},}}#[^\r\n]*")
        while found := own.match(self.text, stop):
            stop = found.end()
        return stop


def _order(old: list[Any], new: list[Any]) -> list[int]:
    """The number in ``old`` of each entry of ``new``, if both have equal entries in another order; else nothing."""
    places: dict[str, list[int]] = {}
    if len(old) == len(new) and old != new:
        for k, value in enumerate(old):
            places.setdefault(repr(value), []).insert(0, k)
    order = [found.pop() for value in new if (found := places.get(repr(value)))]
    return order if len(order) == len(new) else []


def _staying(old: list[Any], new: list[Any]) -> dict[int, int]:
    """The number in ``new`` of each entry of ``old`` that stays: these are the first ones of ``new``, in order.

    An entry stays if it is equal, or has the same name, or if the old and the new name are names of no other entry.
    """
    stays: dict[int, int] = {}
    names, before = [_name(value) for value in new], [_name(value) for value in old]
    for k, value in enumerate(old):
        at = len(stays)
        if at == len(new):
            break
        named = isinstance(value, dict) and isinstance(new[at], dict)
        same = before[k] == names[at] if before[k] in names else names[at] not in before and len(old) <= len(new)
        if new[at] == value or (named and same):
            stays[k] = at
    return stays


def _name(value: Any) -> Any:
    name = value.get("name") if isinstance(value, dict) else None
    return name if isinstance(name, str) else None


def _alike(old: Any, new: Any) -> bool:
    """Whether an entry of a list stays, or is a mapping whose own keys change."""
    return bool(old == new) or (isinstance(old, dict) and isinstance(new, dict))


def _lines(key: str, value: Any, indent: str) -> list[str]:
    """A key of a block with its value; a list of mappings has a line for each."""
    if isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
        return [f"{indent}{key}:", *(f"{indent}  - {flow(v)}" for v in value)]
    return [f"{indent}{key}: {flow(value)}"]


def _end(node: Any) -> int:
    """Where a value's own text ends: the mark of a block lies behind the comments that follow it."""
    if isinstance(node, tuple):
        return _end(node[1])
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        return _end(node.value[-1])
    return int(node.end_mark.index)
