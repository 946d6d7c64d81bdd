"""YAML as people mean it, and nothing that a stranger's file could do beyond that."""

from __future__ import annotations

import math
import re

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mission_file.values import yaml as strict_yaml
from gcsplan.mission_file.values.yaml import cure, lines_of, read_yaml
from tests.support.effort import draws


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read_yaml(text, where="m.yaml")
    assert caught.value.where.startswith("m.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [("5.0e6", 5.0e6), ("5e3", 5000.0), (".5", 0.5), ("-1.", -1.0), ("1e400", math.inf), (".inf", math.inf),
     ("-.Inf", -math.inf), ("12:30", "12:30"), ("010", 10), ("0x1F", 31), ("0o17", 15), ("no", "no"), ("on", "on"),
     ("true", True), ("False", False), ("~", None), ("null", None), ("'5'", "5"), ('"true"', "true"), ("!!str 5", "5"),
     ("2020-01-01", "2020-01-01"), ("1_000", "1_000"), ("|\n  5", "5"), ("-", [None]), ("uav1", "uav1")],
)  # fmt: skip
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    assert read_yaml(text, where="m.yaml") == value


def test_nan_is_a_number() -> None:
    assert math.isnan(read_yaml(".nan", where="m.yaml"))


def test_both_of_pyyamls_parsers_read_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "a: &x {b: 1, c: 5.0e6, d: '1', e: !!str 1, f: }\ng: {<<: *x, b: [2, ~, no]}\n"
    first = read_yaml(text, where="m.yaml")

    class Slow(yaml.SafeLoader):
        resolve = strict_yaml.Loader.resolve

    monkeypatch.setattr(strict_yaml, "Loader", Slow)
    assert read_yaml(text, where="m.yaml") == first
    assert first["g"] == {"b": [2, None, "no"], "c": 5.0e6, "d": "1", "e": "1", "f": None}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\nb: 2\na: 3", "line 3, column 1: the key `a` stands twice"), ("a: {b: 1, b: 1}", "`b` stands twice"),
        ("a: 1\n\tb: 2", "line 2"), ("a:\n\t- 1", "spaces, not tabs"), ("a: [1, 2", "begun in line 1"),
        ("", "empty"), ("# nothing\n", "empty"), ("a: 1\n---\nb: 2", "line 2"), ("{1: 2}", "must be a word"),
        ("{[1]: 2}", "must be a word"), ("a: &x [*x]", "holds itself"), ("a: &x {<<: *x}", "holds itself"),
        ("a: *none", "alias"), ("<<: [1]", "mappings only"), ("a: !!python/object/apply:os.getcwd []", "not allowed"),
        ("a: !!binary aGk=", "not allowed"), ("!!int x", "not allowed"), ("a: \x01", "not YAML"),
        ("a: \ud800", "not YAML"), ("a: " + "9" * 5000, "digits"), ("%YAML 9.0\n---\na", "not YAML"),
    ],
)  # fmt: skip
def test_what_is_not_plain_yaml_is_refused_with_its_place(text: str, words: str) -> None:
    assert words in refusal(text)


def test_an_alias_bomb_is_refused_at_once() -> None:
    bomb = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n"
    bomb += "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 20))
    assert "aliases" in refusal(bomb)


@pytest.mark.parametrize("text", ["[" * 100_000, "{a: " * 5000, "- " * 5000, "? " * 5000])
def test_deep_nesting_is_refused_before_it_is_built(text: str) -> None:
    assert "levels deep" in refusal(text)


def test_too_much_of_anything_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(strict_yaml, "MAX_YAML_NODES", 100)
    assert "more than 100 values" in refusal("[" + "1," * 200 + "]")
    monkeypatch.setattr(strict_yaml, "MAX_YAML_BYTES", 1_000_000)
    assert "1 million" in refusal("a" * 1_000_001)


@settings(max_examples=draws(300))
@given(st.text(st.sampled_from("ab:{}[],&*!|>'\"#%@`-?\n\t 1.~<"), max_size=60) | st.text(max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        value = read_yaml(text, where="m.yaml")
    except InputError:
        return
    assert value is None or isinstance(value, dict | list | str | int | float)


SLIPS = [
    ("a: 1\nname: uav: north\n", "line 2: a colon within a text needs quotes", 'a: 1\nname: "uav: north"\n'),
    ("- name: a, b: c\n", "line 1: a colon within", '- name: "a, b: c"\n'),
    ("version:1\nname: x\n", "line 1: a space is missing after the colon", "version: 1\nname: x\n"),
    ("v:\n  - name: a\n    sysid:1\n    b: 2\n", "line 3: a space is missing after the colon",
     "v:\n  - name: a\n    sysid: 1\n    b: 2\n"),
    ("a: 1\nlink:udp\n", "line 2: a space is missing after the colon", "a: 1\nlink: udp\n"),
    ("v: {name:uav1, sysid: 1}\n", "a space is missing after the colon", "v: {name: uav1, sysid: 1}\n"),
    ("v:\n  -name: a\n    sysid: 1\n", "line 2: a space is missing after the dash", "v:\n  - name: a\n    sysid: 1\n"),
    ("v:\n\ta: 1\n", "line 2: indent with spaces, not tabs", None),
    ("v:\n  a: 1\n\tb: 2\n", "line 3: indent with spaces, not tabs", None),
    ("a:\u00a01\nb: 2\n", "line 1: a no-break space", None),
    ("v: {center: 47.39708, 8.34403, radius_m: 4}\n", "a place within braces has brackets", None),
    ("at: \"47°23'49.5\"N 8°20'38.5\"E\"\n", "written without quotes", "at: 47°23'49.5\"N 8°20'38.5\"E\n"),
    ("name: 'it's here'\n", "written without quotes", "name: it's here\n"),
    ("a:\n  - b: 1\n     c: 2\n", "line 3: `c` begins in column 6, the key above it in column 5", None),
    ("a: 1\nb 2\nc: 3\n", "line 2: a colon is missing after the key", "a: 1\nb: 2\nc: 3\n"),
    ("a: [1, 2\nb: 3\n", "line 1: a closing ] is missing", "a: [1, 2]\nb: 3\n"),
    ("a: {b: 2\nb: 3\n", "line 1: a closing } is missing", "a: {b: 2}\nb: 3\n"),
    ("name: @home\n", "begins with @ needs quotes", 'name: "@home"\n'),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words", "cured"), SLIPS)
def test_a_slip_of_the_pen_is_told_with_its_cure(text: str, words: str, cured: str | None) -> None:
    said = refusal(text)
    assert words in said
    if cured is not None:
        (shown,) = re.findall(r"`(.+)`", said)
        assert shown in cured
        read_yaml(cured, where="m.yaml")


@pytest.mark.parametrize("text", ['a: "x" y\n', "a: [1, 2\n  3]\n  4: 5\n", 'a: "b\nc: 1\n'])
def test_no_cure_is_guessed(text: str) -> None:
    assert "`" not in refusal(text)


@pytest.mark.slow
@settings(max_examples=draws(300))
@given(
    st.text(st.sampled_from("ab:{}[],&*|>'\"#%@`-?\n\t 1.\u00a0°"), max_size=60), st.integers(0, 9), st.integers(0, 9)
)
def test_a_cure_is_one_line_for_any_text(text: str, line: int, begun: int) -> None:
    assert "\n" not in cure(text, line, begun)


def test_a_key_has_the_line_that_it_stands_in() -> None:
    text = "a: 1\n# words\nb:\n  - c: {d: 2}\n    e: x\n  - f\n"
    paths = ["a", "b", "b[0]", "b[0].c", "b[0].c.d", "b[0].e", "b[1]", "b[0].missing", "b[7]", "z", "", "a.b"]
    assert lines_of(text, paths) == [1, 3, 4, 4, 4, 5, 6, 4, 3, None, None, 1]
