"""A changed document is written into its text: the changed values alone, and none where the text has no place."""

from __future__ import annotations

from itertools import permutations

import pytest

from gcsplan.mission_file.values.document import flow, with_document
from gcsplan.mission_file.values.yaml import read_yaml

BLOCK = """\
# head
limits:   # of all
  min_agl_m: 60   # metres
  max_agl_ft: 400

no_fly:
  - {name: a, center: [1, 2], radius_m: 3}   # first

  # behind
vehicles:
- name: uav1   # dash
  via: []
"""


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("a: 1   # one\nb: 2\n", {"a": 5, "b": 2}, "a: 5   # one\nb: 2\n"),
        ("a: 1\nb: {c: 2}", {"a": 1, "b": {"c": 2}, "d": [{"e": 1}]}, "a: 1\nb: {c: 2}\nd:\n  - {e: 1}"),
        ("a: {b: 1}\n", {"a": {"b": 1, "c": "x y"}}, 'a: {b: 1, c: "x y"}\n'),
        ("a: {}\n", {"a": {"c": 1}}, "a: {c: 1}\n"),
        ("a: [1, 2]\n", {"a": [1, 2, 3]}, "a: [1, 2, 3]\n"),
        ("a: []   # none\n", {"a": [1]}, "a: [1]   # none\n"),
        ("a:\n  - 1  # one\n# end\n", {"a": [1, 2]}, "a:\n  - 1  # one\n  - 2\n# end\n"),
        ("a:\nb: 1\n", {"a": [3], "b": 1}, "a: [3]\nb: 1\n"),
        ("a_ft: 3 # feet\n", {"a_m": 1}, "a_m: 1 # feet\n"),
        ("a:\r\n  b: 1\r\nc: 2\r\n", {"a": {"b": 1, "d": 4}, "c": 2}, "a:\r\n  b: 1\r\n  d: 4\r\nc: 2\r\n"),
        ("a:\n  - {b: 1}", {"a": [{"b": 1}, {"b": 2}], "c": 3}, "a:\n  - {b: 1}\n  - {b: 2}\nc: 3"),
        ("a: |\n  text\nb: 1\n", {"a": "text\n", "b": 1, "c": 2}, "a: |\n  text\nb: 1\nc: 2\n"),
        ("a:\n  - 1  # one\n  - 2\n# end\n", {"a": [2]}, "a:\n  - 2\n# end\n"),
        ("a:\n- {b: 1}\n- b: 2\n  c: 3\n- 4", {"a": [{"b": 1}, 4]}, "a:\n- {b: 1}\n- 4"),
        (
            "a:\n- {name: xx}\n- {name: yy, b: 1}  # y\n",
            {"a": [{"name": "yy", "c": 2}, {"name": "zz"}]},
            "a:\n- {name: yy, c: 2}  # y\n- {name: zz}\n",
        ),
        ("a:\n- {name: xx}  # x\n", {"a": [{"name": "zz", "b": 1}]}, "a:\n- {name: zz, b: 1}  # x\n"),
        ("a:\n- {name: xx, b: 1, c: 2}  # x\n", {"a": [{"name": "xx", "d": 1}]}, "a:\n- {name: xx, d: 1}  # x\n"),
        ("a:\n- 1\n- 2  # two\n", {"a": [1, 3]}, "a:\n- 1\n- 3\n"),
        ("a:\n  b: 1\n  c: 2  # two\n  d: 3\n", {"a": {"b": 1, "d": 3}}, "a:\n  b: 1\n  d: 3\n"),
        ("a:\n  - b: 1\n    # of b\n  # next\n", {"a": [{"b": 1}, 2]}, "a:\n  - b: 1\n    # of b\n  - 2\n  # next\n"),
        ("b: 1\na: |\n  text\n", {"b": 1, "a": "text\n", "c": 2}, "b: 1\na: |\n  text\nc: 2\n"),
    ],
)
def test_only_the_changed_values_are_written(old: str, new: dict[str, object], expected: str) -> None:
    assert with_document(old, new) == expected
    assert read_yaml(expected, where="") == new


def test_comments_and_empty_lines_stay_where_they_are() -> None:
    new = read_yaml(BLOCK, where="")
    new["limits"] = {"min_agl_m": 60, "max_agl_m": 100}
    new["no_fly"].append({"center": [3, 4], "radius_m": 5})
    new["vehicles"][0]["via"] = [[1, 2]]
    text = with_document(BLOCK, new)
    assert text is not None
    assert read_yaml(text, where="") == new
    gone = [line for line in BLOCK.splitlines() if line not in text.splitlines()]
    assert gone == ["  max_agl_ft: 400", "  via: []"]
    assert text.splitlines()[text.splitlines().index(BLOCK.splitlines()[6]) + 1] == "  - {center: [3, 4], radius_m: 5}"


@pytest.mark.parametrize("text", ["a: {b: 2, c: 1}\n", "base: &b {a: 1}\nc: {<<: *b, d: 1}\n"])
def test_a_key_that_goes_has_no_place(text: str) -> None:
    new = read_yaml(text, where="")
    inner = new.get("c", new)
    del inner["a"]
    assert with_document(text, new) is None


@pytest.mark.parametrize("value", ["no", "1", "", "a: b", "ünd", "x#", True, None, 1e-5, [1, {"a": 2.5}], -0.0, 1e300])
def test_a_value_on_one_line_is_read_as_itself(value: object) -> None:
    assert read_yaml(f"a: {flow(value)}", where="") == {"a": value}


LISTED = """\
no_fly:
  # the mast, since May
  - name: mast   # of steel
    radius_m: 5
      # its height is not known
  - {name: pond}   # the pond

  # the wood
  - name: wood
after: 1"""


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_an_entry_that_is_moved_takes_its_comments_along(order: tuple[int, ...]) -> None:
    old = read_yaml(LISTED, where="")
    new = {**old, "no_fly": [old["no_fly"][k] for k in order]}
    text = with_document(LISTED, new)
    assert text is not None
    assert read_yaml(text, where="") == new
    assert sorted(text.splitlines()) == sorted(LISTED.splitlines())
    lines = text.splitlines()
    for above, below in (
        ("  # the mast, since May", "  - name: mast   # of steel"),
        ("  # the wood", "  - name: wood"),
    ):
        assert lines[lines.index(below) - 1] == above
    assert lines[lines.index("    radius_m: 5") + 1] == "      # its height is not known"


@pytest.mark.parametrize("text", ["a: [1, 2 , 3]  # x\n", "a:\r\n- 1\r\n- 2 # two\r\n- 3", "a: [1,\n 2, # two\n 3]\n"])
def test_a_list_of_numbers_is_moved_in_place(text: str) -> None:
    found = with_document(text, {"a": [3, 1, 2]})
    assert found is not None
    assert read_yaml(found, where="") == {"a": [3, 1, 2]}
    assert len(found) == len(text)
