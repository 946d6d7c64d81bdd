"""The language: docstrings, comments, messages, option helps and documents are sentences that one reads once.

`python -m tests.test_language [FILE ...]` prints each place that breaks a rule, with its cure.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
CODE = ("gcsplan", "tests/support", "tests/oracles", "tests/campaigns", "sitl_tests", "noxfile.py", "docs")
DOCUMENTS = ("README.md", "CHANGELOG.md", "changelog.d", "docs")

pytestmark = pytest.mark.xdist_group("language")  # one process reads the files


@dataclass(frozen=True)
class Rule:
    """A pattern that no sentence may have, and the cure. ``where``: it counts in paths that this finds."""

    pattern: re.Pattern[str]
    cure: str
    where: re.Pattern[str] = re.compile("")


def rule(pattern: str, cure: str, where: str = "") -> Rule:
    return Rule(re.compile(pattern, re.IGNORECASE), cure, re.compile(where))


TERMS = {
    "told": "name who reports what: the vehicle reports its state; the error is reported",
    "asked": "name who requests, or use the noun: requested, given, the request",
    "said": "name what is written or sent: the notes, the message, the key's value",
    "wanted": "give the order (give 1 to 8 processes), or the noun: expected, needed, requested",
}
"""Participles that stood for a dozen things each."""

RULES = (
    *(rule(rf"\b{term}\b", cure) for term, cure in TERMS.items()),
    rule(
        r"(?:^|[.!?:;,(—–]\s|\b(?:of|only|all|also|even|just|alone|both|for|by|in|on|at|without|see|nor|that|among)\s)"
        r"(?:(?:that|those) of|those (?:that|which|who|with|without))\b",
        "name the thing: 'the limits of the check', not 'those of the check'",
    ),
    rule(
        r"\bwhat (?:is|are|was|were)\b[^.:;,()|]{0,60}\s(?:is|are|was|were)\b",
        "name the thing: 'a stale file is refused', not 'what is stale is refused'",
    ),
    rule(r"(?-i:^Of\b)", "begin with the noun: 'The limits of a leg', not 'Of a leg: the limits'"),
    rule(r"\bnine in ten\b", "p90 (docs/glossary.md)"),
    rule(r"[\"“*]?\bhalf\b[\"”*]*(?=\s*[,|:]|\s+and p90)", "median (docs/glossary.md)", where=r"bench"),
)

COLUMNS = {"gap_asked_percent"}
"""Names that are columns of files, a contract."""

A_TERM = re.compile("|".join(TERMS), re.IGNORECASE)
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
LITERAL = re.compile(r"``.+?``|`[^`]+`|\{[^{}\s]*\}|(?<=\])\([^)\s]*\)|https?://\S+", re.DOTALL)
"""Names and code within a sentence: they follow the code, not the language."""
FENCED = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r"(?:\S.*\n?)+")  # lines with no empty line between them
BULLET = re.compile(r"\s*(?:[-*+]|\d+\.|#+|>|\|)\s+")


@dataclass(frozen=True)
class Sentences:
    """A text of a file, and the line on which it begins."""

    line: int
    text: str


def masked(pattern: re.Pattern[str], text: str) -> str:
    """The text with all that ``pattern`` finds replaced by as many characters that are no words."""
    return pattern.sub(lambda found: re.sub(r"\S", "~", found[0]), text)


def tokens(source: str) -> list[tokenize.TokenInfo]:
    return list(tokenize.generate_tokens(io.StringIO(source).readline))


def comments(found: Iterable[tokenize.TokenInfo]) -> Iterator[Sentences]:
    """The comments of a module; lines of comments that follow each other are one text."""
    begins, lines, column = 0, list[str](), -1
    for token in found:
        if token.type == tokenize.COMMENT:
            line, at = token.start
            if lines and (line != begins + len(lines) or at != column):
                yield Sentences(begins, "\n".join(lines))
                lines = []
            begins, column = (begins if lines else line), at
            lines.append(token.string.lstrip("#: "))
    if lines:
        yield Sentences(begins, "\n".join(lines))


def literals(nodes: Sequence[ast.AST]) -> Iterator[Sentences]:
    """The texts of a module: docstrings, messages, helps, keys. A formatted value stands as {}."""
    formatted = [node for node in nodes if isinstance(node, ast.JoinedStr)]
    parts = {id(part) for whole in formatted for part in whole.values}
    for whole in formatted:
        words = [str(part.value) if isinstance(part, ast.Constant) else "{}" for part in whole.values]
        yield Sentences(whole.lineno, "".join(words))
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts:
            yield Sentences(node.lineno, node.value)


def paragraphs(text: str) -> Iterator[Sentences]:
    """The paragraphs, list items and rows of a document, without its code."""
    for block in BLOCK.finditer(masked(FENCED, text)):
        line = text.count("\n", 0, block.start()) + 1
        part = list[str]()
        for row in block[0].splitlines():
            if part and BULLET.match(row):
                yield Sentences(line, "\n".join(part))
                line, part = line + len(part), []
            part.append(row if part else BULLET.sub("", row, count=1))
        yield Sentences(line, "\n".join(part))


def broken(where: str, sentences: Iterable[Sentences]) -> Iterator[str]:
    """The places of a file whose ``sentences`` break a rule."""
    rules = [one for one in RULES if one.where.search(where)]
    for one in sentences:
        if " " not in one.text.strip():
            continue  # a name or a key
        text = masked(LITERAL, one.text)
        flat = re.sub(r"\s", " ", text)
        indent = len(flat) - len(flat.lstrip())
        for found, cure in ((f, r.cure) for r in rules for f in r.pattern.finditer(flat[indent:])):
            begin, end = found.start() + indent, found.end() + indent
            line = one.line + text.count("\n", 0, begin + len(found[0]) - len(found[0].lstrip(" .,;:(")))
            shown = re.sub(r"\s+", " ", one.text[max(0, begin - 30) : end + 30]).strip()
            yield f"{where}:{line}: …{shown}…: {cure}"


def names(where: str, found: Iterable[tokenize.TokenInfo], nodes: Sequence[ast.AST]) -> Iterator[str]:
    """The names in a module's code that have one of `TERMS` in them; the data of a `Note` is a contract."""
    data = {
        (key.lineno, key.col_offset)
        for node in nodes
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Note"
        for key in node.keywords
    }
    for token in found:
        if token.type == tokenize.NAME and A_TERM.search(token.string) and token.string not in COLUMNS:
            words = {word.lower() for word in WORD.findall(token.string)}
            is_data = (token.start[0], column_of(token)) in data
            yield from (
                f"{where}:{token.start[0]}: {token.string}: {cure}"
                for term, cure in TERMS.items()
                if term in words and not is_data
            )


def column_of(token: tokenize.TokenInfo) -> int:
    """The column of a token as the syntax tree counts it, in bytes."""
    return len(token.line[: token.start[1]].encode())


def findings(path: Path) -> list[str]:
    """Each place of a file that breaks a rule, as path:line: words: cure."""
    where, text = path.relative_to(TOP).as_posix(), path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return list(broken(where, paragraphs(text)))
    found, nodes = tokens(text), list(ast.walk(ast.parse(text)))
    return [*broken(where, [*comments(found), *literals(nodes)]), *names(where, found, nodes)]


@cache
def files() -> tuple[Path, ...]:
    """All files that the language counts in."""
    found = [(TOP / name, suffix) for group, suffix in ((CODE, ".py"), (DOCUMENTS, ".md")) for name in group]
    each = [sorted(path.rglob(f"*{suffix}")) if path.is_dir() else [path] for path, suffix in found]
    return tuple(path for group in each for path in group)


@pytest.mark.nightly
def test_sentences_are_plain() -> None:
    assert [one for path in files() for one in findings(path)] == []


@pytest.mark.parametrize(
    ("sentence", "is_plain"),
    [
        ("What is told of files that are at hand: those that were judged, then the others.", False),
        ("--jobs 0: 1 to 64 processes are wanted", False),
        ("The limits of the check.", True),
        ("``limits``: those of the check.", False),
        ("The limits are lower than those of the check.", True),
        ("The fence, and zones: those that lie near it.", False),
        ("Of each leg: its length.", False),
        ("What is stale is refused.", False),
        ("What is left: two files.", True),
        ("Nine in ten take 3 s.", False),
        ("The autopilot asks for item 3, and says why.", True),
        ("The key `asked` and the ``said`` one.", True),
        ("A height has no meaning without a datum: two datums differ by up to 107 m.", True),
    ],
)
def test_rules_find_riddles_alone(sentence: str, is_plain: bool) -> None:
    assert (list(broken("page.md", [Sentences(1, sentence)])) == []) is is_plain


def test_half_names_no_median_in_benches() -> None:
    header = [Sentences(1, "| swarm | over: half, worst |")]
    assert list(broken("docs/benchmarks.md", header))
    assert not list(broken("docs/tutorial.md", header))
    assert not list(broken("docs/benchmarks.md", [Sentences(1, "half of them with zones")]))


def test_places_are_lines_of_the_file() -> None:
    source = '"""Told.\n\nIt was told.\n"""\n# first\n# and told\nsay(f"it was\\n {x} told")\n'
    found = list(broken("x.py", [*comments(tokens(source)), *literals(list(ast.walk(ast.parse(source))))]))
    assert sorted({int(one.split(":")[1]) for one in found}) == [1, 3, 6, 8]
    assert [one.split(":")[1] for one in broken("x.md", paragraphs("# A\n\nB c\n- d\n- was told\n"))] == ["5"]


def test_names_are_judged_but_for_the_data_of_notes() -> None:
    source = "was_told = Told(wanted_m=Note('x', wanted_m=told))"
    found = [one.split(": ")[1] for one in names("x.py", tokens(source), list(ast.walk(ast.parse(source))))]
    assert found == ["was_told", "Told", "wanted_m", "told"]


if __name__ == "__main__":
    chosen = [Path(name).resolve() for name in sys.argv[1:]] or files()
    places = [one for path in chosen if path in files() for one in findings(path)]
    print(*places, sep="\n", end="\n" if places else "")
    sys.exit(1 if places else 0)
