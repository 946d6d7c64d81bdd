"""CHANGELOG.md and the fragments that go into its next section."""

from __future__ import annotations

import re
import tomllib

from gcsplan import __version__
from tests.support.paths import REPOSITORY

FRAGMENTS = sorted(path for path in (REPOSITORY / "changelog.d").iterdir() if path.name != "README.md")


def test_a_fragment_is_named_and_written_like_one() -> None:
    config = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["towncrier"]
    kinds = "|".join(kind["directory"] for kind in config["type"])
    for path in FRAGMENTS:
        assert re.fullmatch(rf"\+[a-z0-9-]+\.({kinds})\.md", path.name), path.name
        text = path.read_text(encoding="utf-8")
        assert re.fullmatch(r"[^\s-].*[.)]\n", text, re.DOTALL), f"{path.name}: sentences, without a dash before them"
        assert max(map(len, text.splitlines())) <= 130, path.name


def test_the_next_section_has_its_place() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    config = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["towncrier"]
    assert text.count(config["start_string"]) == 1
    versions = re.findall(r"^## (\S+?)(?:, \d{4}-\d\d-\d\d)?$", text, re.MULTILINE)
    assert versions == sorted(set(versions), key=lambda v: tuple(map(int, v.split("."))), reverse=True)
    assert versions[0] == __version__
    assert len(text[text.index("\n## 0.1.0") :].strip().splitlines()) <= 40
