"""Parts of the site that are made from the code while it is built: a hook of mkdocs, named in mkdocs.yml.

A page says where such a part belongs by a line ``<!-- made: NAME -->``; `PARTS` has the function for each name. What is
built loads nothing from elsewhere, which is looked at in the end. Functions without ``on_`` need no mkdocs.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

import gcsplan
from gcsplan import errors
from gcsplan.cli.process import exit as ending
from gcsplan.mission_file import json_schema
from gcsplan.mission_file.values import schema, units
from gcsplan.notes.note import TEXTS
from gcsplan.planners import registry
from gcsplan.sim.vehicle.firmware import FIRMWARE_CHANGES

TOP = Path(__file__).resolve().parents[1]
PACKAGE = Path(gcsplan.__file__).parent
MARK = re.compile(r"^<!-- made: ([a-z-]+) -->$", re.MULTILINE)

# -- the mission file -------------------------------------------------------------------------------------------------


def sections() -> list[tuple[str, type[schema.Keys]]]:
    """Every section with its place in the file, in the order of the file; ``[]`` stands for each entry of a list."""
    found: list[tuple[str, type[schema.Keys]]] = []

    def walk(kind: type[schema.Keys], place: str) -> None:
        found.append((place, kind))
        for key, field in kind.model_fields.items():
            for inner in _sections_in(field.annotation):
                if key in kind.__annotations__ and inner not in (*schema.POINT_FORMS.values(), *(k for _, k in found)):
                    walk(inner, f"{place}.{key}".lstrip(".") + ("[]" if _is_list(field.annotation) else ""))

    walk(schema.MissionKeys, "")
    return [*found, *schema.POINT_FORMS.items()]


def _sections_in(annotation: Any) -> Iterator[type[schema.Keys]]:
    if isinstance(annotation, type) and issubclass(annotation, schema.Keys):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _sections_in(inner)


def _is_list(annotation: Any) -> bool:
    return getattr(annotation, "__origin__", None) is list or any(
        _is_list(inner) for inner in getattr(annotation, "__args__", ())
    )


def mission_file() -> str:
    """A table of keys for each section."""
    lines = []
    for place, kind in sections():
        whole = kind.model_json_schema()
        title = f"`{place}`" if place else "The whole file"
        lines += [f"## {title}", "", "| key | value | default | what it is |", "| --- | --- | --- | --- |"]
        for key, field in kind.model_fields.items():
            if key not in kind.__annotations__:
                continue
            value = _value(key, whole["properties"][key], whole.get("$defs", {}))
            meaning = json_schema.descriptions().get((kind.__name__, key), "")
            lines.append(f"| `{key}` | {value} | {_default(key, field)} | {meaning} |")
        lines.append("")
        if issubclass(kind, schema.LimitKeys) and kind is not schema.LimitKeys:
            lines += [
                "Every key of [`limits`](#limits) may stand here too, and then counts for this vehicle alone.",
                "",
            ]
    return "\n".join(lines)


def _default(key: str, field: Any) -> str:
    if field.is_required():
        return "**required**"
    if key in json_schema.LATE_DEFAULTS:
        return f"`{json_schema.LATE_DEFAULTS[key]:g}`"
    value = field.default
    if value is None or value == [] or isinstance(value, schema.Keys):
        return "–"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _value(key: str, entry: Mapping[str, Any], named: Mapping[str, Any]) -> str:
    """The values that a key takes, from its JSON schema."""
    if "$ref" in entry:
        name = entry["$ref"].rsplit("/", 1)[-1]
        return next((form for form, kind in schema.POINT_FORMS.items() if kind.__name__ == name), "section")
    choices = entry.get("anyOf") or entry.get("oneOf")
    if choices:
        words = [_value(key, c, named) for c in choices if c.get("type") != "null"]
        return " or ".join(dict.fromkeys(words))
    if "const" in entry:
        return f"`{entry['const']}`"
    if "enum" in entry:
        return ", ".join(f"`{word}`" for word in entry["enum"])
    if entry.get("type") == "array":
        inner = _value(key, entry["items"], named)
        if inner == "number" and entry.get("minItems") == 2:
            return "[lat, lon]" if entry["maxItems"] == 2 else "[lat, lon] or [lat, lon, agl_m]"
        if entry.get("minItems") == entry.get("maxItems") == 2:
            unit, _, bounds = inner.partition(", ")
            return f"[{unit}, {unit}]" + (f", each {bounds}" if bounds else "")
        return f"list of {inner}" + ("s" if inner == "section" else "")
    names = {
        "number": "number",
        "integer": "whole number",
        "string": "text",
        "object": "mapping",
        "boolean": "`true`, `false`",
    }
    kind = names[entry["type"]]
    unit = "" if kind == "text" else units.UNIT_SYMBOLS.get(units.unit_end(key), "")
    return ", ".join(word for word in (unit or kind, _bounds(entry)) if word)


def _bounds(entry: Mapping[str, Any]) -> str:
    low, high = entry.get("minimum"), entry.get("maximum")
    above, below = entry.get("exclusiveMinimum"), entry.get("exclusiveMaximum")
    if high is not None and high >= 1e6:  # wide enough to stop slips alone
        high = None
        low = low if low is None or low > -1e6 else None
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    signs = {"≥": low, ">": above, "≤": high, "<": below}
    return ", ".join(f"{sign} {value:g}" for sign, value in signs.items() if value is not None)


def other_units() -> str:
    """A table of the units that a key may be written in besides its own."""
    lines = ["| keys that end in | may end in | with the value in |", "| --- | --- | --- |"]
    for own, others in units.OTHERS.items():
        ends = ", ".join(f"`{end}`" for end in others)
        sizes = [f"{o.symbol} ({o.size:.7g} {units.UNIT_SYMBOLS[own]}{' for 1 V' if end == units.CHARGE else ''})"
                 for end, o in others.items()]  # fmt: skip
        lines.append(f"| `{own}` | {ends} | {', '.join(sizes)} |")
    return "\n".join(lines)


# -- the command line -------------------------------------------------------------------------------------------------


def commands() -> list[tuple[str, Any]]:
    """Every command with its full name, groups before what is in them."""
    import typer.main

    from gcsplan.cli.command_table import app

    found: list[tuple[str, Any]] = []

    def walk(name: str, command: Any) -> None:
        found.append((name, command))
        for word, inner in getattr(command, "commands", {}).items():
            walk(f"{name} {word}", inner)

    walk("gcsplan", typer.main.get_command(app))
    return found


def command_line() -> str:
    """A section for each command: what it does, its arguments, its options."""
    lines = []
    for name, command in commands():
        lines += [f"## `{name}`", "", inspect.cleandoc(command.help or ""), ""]
        shown = [p for p in command.params if p.name != "help"]
        arguments = [p for p in shown if p.param_type_name == "argument"]
        options = [p for p in shown if p.param_type_name == "option"]
        inside = getattr(command, "commands", {})
        words = [_metavar(a) if a.required else f"[{_metavar(a)}]" for a in arguments]
        usage = [name, *(["[OPTIONS]"] if options else []), *(["COMMAND"] if inside else words)]
        lines += ["```", " ".join(usage), "```", ""]
        if arguments:
            lines += ["| argument | what it is |", "| --- | --- |"]
            lines += [f"| `{_metavar(a)}` | {_cell(a.help)} |" for a in arguments]
            lines.append("")
        if options:
            lines += ["| option | default | what it does |", "| --- | --- | --- |"]
            lines += [f"| {_option(o)} | {_option_default(o)} | {_cell(o.help)} |" for o in options]
            lines.append("")
        for word, one in inside.items():
            anchor = f"{name} {word}".replace(" ", "-")
            lines.append(f"- [`{name} {word}`](#{anchor}): {_cell(one.get_short_help_str(200))}")
        lines.append("")
    return "\n".join(lines)


def _metavar(argument: Any) -> str:
    return str(argument.metavar or argument.name.upper())


def _option(option: Any) -> str:
    value = "" if option.is_flag else f" {option.metavar or option.type.name.upper()}"
    words = [f"`{word}{value}`" for word in (*option.opts, *option.secondary_opts)]
    return ", ".join(words) + (" (repeatable)" if option.multiple else "")


def _option_default(option: Any) -> str:
    if option.required:
        return "**required**"
    if option.is_flag and option.secondary_opts:
        return f"`{option.opts[0] if option.default else option.secondary_opts[0]}`"
    return "–" if option.is_flag or option.default in (None, [], (), "") else f"`{option.default}`"


def _cell(text: str | None) -> str:
    """Text as a cell of a table takes it."""
    return " ".join((text or "").split()).replace("|", "\\|").replace("<", "&lt;").replace("*.", "\\*.")


# -- errors and messages ----------------------------------------------------------------------------------------------


def kinds() -> list[type[errors.GcsplanError]]:
    """Every kind of error, by exit code."""
    found = {k for module in (errors, ending) for k in vars(module).values()
             if isinstance(k, type) and issubclass(k, errors.GcsplanError)}  # fmt: skip
    return sorted(found, key=lambda kind: (kind.exit_code, kind.__name__))


def exit_codes() -> str:
    """The codes, with the errors that end in them and the reasons that ``--json`` gives."""
    lines = ["| code | error | Python | what happened | `reason` |", "| --- | --- | --- | --- | --- |",
             "| 0 | – | – | done, and verified if it was uploaded | – |"]  # fmt: skip
    for kind in kinds():
        bases = [b.__name__ for b in kind.__bases__]
        text = " ".join(inspect.cleandoc(kind.__doc__ or "").split("\n\n")[0].split())
        text = "A bug of ours: no other kind fits." if kind is errors.GcsplanError else text
        reasons = ", ".join(f"`{word}`" for word in reasons_of(kind))
        lines.append(f"| {kind.exit_code} | `{kind.__name__}` | {', '.join(bases)} | {_cell(text)} | {reasons} |")
    return "\n".join(lines)


def reasons_of(kind: type[errors.GcsplanError]) -> list[str]:
    """Words that ``reason`` may be, as the code says them."""
    if kind is errors.NoMission:
        return list(get_args(errors.NoMissionReason))
    reasons = [
        keyword.value
        for message in messages()
        if _RAISED[message.raised] is kind
        for keyword in message.call.keywords
        if keyword.arg == "reason"
    ]
    words = [node.value for value in reasons for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return list(dict.fromkeys([kind.default_reason, *(word for word in words if str(word).isidentifier())]))


_RAISED: Mapping[str, type[errors.GcsplanError]] = {
    **{kind.__name__: kind for kind in kinds()},
    "Mistake": errors.InputError,
    "Refusal": errors.NoMission,
    "NoPath": errors.NoMission,
}
"""Names that messages are handed to, and the kind of error that carries them."""


class Message(NamedTuple):
    """One message as it stands in the code; ``‹…›`` is a value of the moment."""

    module: str
    raised: str
    text: str
    call: ast.Call


@cache
def messages() -> tuple[Message, ...]:
    """Every message that is written out where it is raised, module by module."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        module = path.relative_to(PACKAGE).with_suffix("").as_posix()
        source = path.read_text(encoding="utf-8")
        if not any(name in source for name in _RAISED):
            continue
        tree = ast.parse(source)
        scopes = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)] or [tree]
        seen: set[ast.AST] = set()
        for scope in scopes:
            nodes = list(ast.walk(scope))
            calls = [node for node in nodes if isinstance(node, ast.Call) and node not in seen]
            seen.update(calls)
            calls = [node for node in calls if _called(node) in _RAISED]
            if not calls:
                continue
            named = {ast.unparse(node.targets[0]): node.value for node in nodes if isinstance(node, ast.Assign)}
            for node in calls:
                raised = _called(node)
                given = node.args[1:2] if raised == "Mistake" else node.args[:1]
                text = _text(given[0], named) if given else ""
                if len(re.sub(r"‹.*?›|\W", "", text)) > 3:
                    found.append(Message(module, raised, text, node))
    return tuple(found)


def _called(node: ast.Call) -> str:
    """The last word of what is called: ``InputError`` in ``errors.InputError(…)``."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def _text(node: ast.expr, named: Mapping[str, ast.expr], depth: int = 0) -> str:
    """The words of an expression; names of the same function are followed."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part, named, depth) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        value = node.value
        if isinstance(value, ast.Call):
            value = value.args[0] if ast.unparse(value.func).endswith(".join") else value.func
        name = ast.unparse(value).split("[")[0].split(".")[-1].strip("_ ")
        return f"‹{name if name.isidentifier() and not hasattr(builtins, name) else '…'}›"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left, named, depth) + _text(node.right, named, depth)
    if isinstance(node, ast.IfExp):
        return _text(node.body, named, depth)
    if isinstance(node, ast.Name) and node.id in named and depth < 3:
        return _text(named[node.id], named, depth + 1)
    return "‹…›"


def all_messages() -> str:
    """A table of messages for each kind of error."""
    lines = []
    for code in sorted({kind.exit_code for kind in kinds()}):
        rows = {}
        for message in messages():
            if _RAISED[message.raised].exit_code == code:
                rows[message.text] = message.module
        if rows:
            lines += [f"## Exit code {code}", "", "| message | from |", "| --- | --- |"]
            lines += [f"| {_cell(text)} | `{module}` |" for text, module in sorted(rows.items(), key=lambda r: r[1])]
            lines.append("")
    return "\n".join(lines)


def all_notes() -> str:
    """The table of notes: the code that ``--json`` has, and the sentence."""
    rows = [f"| `{code}` | {_cell(_shown_text(text))} |" for code, text in sorted(TEXTS.items())]
    return "\n".join(["| code | sentence |", "| --- | --- |", *rows])


def _shown_text(text: str) -> str:
    """A sentence of the catalogue with ``‹name›`` for its data, and both words where a number decides."""

    def shown(field: re.Match[str]) -> str:
        name, _, form = field[1].partition(":")
        return form if name == "key" else form.replace("|", "/") if "|" in form else f"‹{name}›"

    return re.sub(r"\{(.*?)\}", shown, text)


# -- the rest ---------------------------------------------------------------------------------------------------------


def planners() -> str:
    """The table of planners."""
    lines = ["| name | what it does | from | defaults |", "| --- | --- | --- | --- |"]
    for entry in registry.rows():
        defaults = ", ".join(f"{key} {value}" for key, value in entry.defaults.items())
        lines.append(f"| `{entry.name}` | {entry.summary} | {entry.paper or '–'} | {defaults} |")
    return "\n".join(lines)


def firmware_changes() -> str:
    """The table of what differs between the versions of the simulated vehicles."""
    lines = ["| since | what | before | since then |", "| --- | --- | --- | --- |"]
    for c in FIRMWARE_CHANGES:
        lines.append(f"| {c.family} {c.since[0]}.{c.since[1]} | {c.what} | {c.before} | {c.after} |")
    return "\n".join(lines)


def from_top(name: str) -> str:
    """A file of the repository as a page; its links count from here."""
    text = (TOP / name).read_text(encoding="utf-8").replace("](docs/", "](")
    return re.sub(r"\]\((CONTRIBUTING|CHANGELOG)\.md\)", lambda link: link[0].lower(), text)


PARTS: Mapping[str, Callable[[], str]] = {
    "mission-file": mission_file,
    "other-units": other_units,
    "command-line": command_line,
    "exit-codes": exit_codes,
    "messages": all_messages,
    "notes": all_notes,
    "planners": planners,
    "firmware-changes": firmware_changes,
    "readme": lambda: from_top("README.md"),
    "changelog": lambda: from_top("CHANGELOG.md"),
    "contributing": lambda: from_top("CONTRIBUTING.md"),
}


# -- mkdocs -----------------------------------------------------------------------------------------------------------

FOREIGN = re.compile(r"""<(?:script|img|iframe|source|video|audio)[^>]*\ssrc=["']?(?:https?:)?//[^>]*>"""
                     r"""|<link[^>]*rel=["']?(?:stylesheet|preconnect|preload|icon)[^>]*href=["']?(?:https?:)?//[^>]*>"""
                     r"""|@import\s+["'(]*(?:url\()?["']?https?://|url\(["']?https?://""")  # fmt: skip
"""What a browser would load from elsewhere by itself."""


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the parts that are made from the code where the page wants them."""
    return MARK.sub(lambda mark: PARTS[mark.group(1)](), markdown)


def on_post_build(config: Any) -> None:
    """End the build where a page would load something from elsewhere."""
    from mkdocs.exceptions import PluginError

    for path in sorted(Path(config.site_dir).rglob("*")):
        if path.suffix in (".html", ".css") and (found := FOREIGN.search(path.read_text(encoding="utf-8"))):
            raise PluginError(f"{path}: loads from elsewhere: {found.group()[:200]}")
