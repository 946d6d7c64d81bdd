"""A short run of the campaign of sizes, what it draws, and what it counts as a fault."""

from __future__ import annotations

import ast
import os
import random
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator

import pytest

from tests.campaigns import sizes
from tests.support.paths import REPOSITORY

SHORT = """
import sys
from tests.campaigns import sizes
if __name__ == "__main__":
    sys.exit(sizes.campaign({}, 60.0, 1, 30))
"""


@pytest.mark.nightly
@pytest.mark.skipif(os.name != "posix", reason="runs forks")
@pytest.mark.parametrize("kinds", ["sizes.FILES", "sizes.WORLDS"])
def test_a_short_campaign_of_sizes_finds_nothing(kinds: str) -> None:
    command = [sys.executable, "-c", SHORT.format(kinds)]
    clocked = {name: value for name, value in os.environ.items() if name != "GCSPLAN_CLOCK"}
    ended = subprocess.run(command, cwd=REPOSITORY, env=clocked, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert re.search(r"^\d+ inputs, 0 faults, the next seed is \d+$", ended.stdout, re.MULTILINE)


def test_amounts_lie_where_their_sizes_state() -> None:
    rng = random.Random(1)
    drawn: Counter[str] = Counter()
    for size in sizes.SIZES.values():
        for _ in range(300):
            count, where = sizes.amount(size, rng)
            drawn[where] += 1
            if where == "beyond":
                assert size.refused is not None
                assert count > size.refused
            else:
                assert size.least <= count <= size.most
    assert drawn["below"] > drawn["beyond"] > drawn["at"] > 0


def test_what_an_input_owes() -> None:
    size = sizes.Size(sizes.SIZES["items"].make, 10, 5.0, 10)
    assert sizes.faults(size, "at", 0, 4.9, 900.0, "") == []
    assert sizes.faults(size, "beyond", 2, 1.0, 100.0, "gcsplan: too many") == []
    for where, code, took_s, held_mb, words in (
        ("at", 70, 1.0, 100.0, ""), ("at", 0, 5.1, 100.0, ""), ("at", 0, 1.0, 1001.0, ""),
        ("at", 4, 1.0, 100.0, "Traceback (most recent call last):"), ("beyond", 0, 1.0, 100.0, ""),
        ("below", 2, 1.0, 100.0, "gcsplan: refused"), ("at", -9, 1.0, 100.0, ""),
    ):  # fmt: skip
        assert sizes.faults(size, where, code, took_s, held_mb, words)


def test_every_kind_is_in_the_table_of_limits() -> None:
    """With the seconds that the campaign holds it to."""
    text = (REPOSITORY / "docs" / "safety.md").read_text(encoding="utf-8")
    table = text[text.index("## How much is taken") : text.index("## Files and folders")]
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    for kind, size in sizes.SIZES.items():
        (row,) = [r for r in rows if f"`{kind}`" in r]
        assert re.search(rf"`{kind}`[^;|]*, at most {size.within_s:g} s", row), kind


SERVER = """
import sys
from tests.campaigns import sizes
if __name__ == "__main__":
    sizes.warm()
    for line in sys.stdin:
        with sizes.place():
            ended = sizes.run(line.strip(), sizes.SIZES[line.strip()].most, 1)
        print(repr(ended), flush=True)
"""


@pytest.fixture(scope="module")
def warmed() -> Iterator[subprocess.Popen[str]]:
    """A process that has imported all, reads kinds and prints how an input of each ended, run in a fork of it."""
    clocked = {name: value for name, value in os.environ.items() if name != "GCSPLAN_CLOCK"}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", SERVER], cwd=REPOSITORY, env=clocked, text=True, **pipes) as process:
        yield process
        process.communicate()


@pytest.mark.nightly
@pytest.mark.skipif(os.name != "posix", reason="runs forks")
@pytest.mark.parametrize("kind", list(sizes.SIZES))
def test_an_input_at_the_limit_takes_what_is_stated(warmed: subprocess.Popen[str], kind: str) -> None:
    assert warmed.stdin is not None
    assert warmed.stdout is not None
    warmed.stdin.write(f"{kind}\n")
    warmed.stdin.flush()
    answer = warmed.stdout.readline()
    assert answer, f"the process of all inputs ended with {warmed.poll()}"
    assert sizes.faults(sizes.SIZES[kind], "at", *ast.literal_eval(answer)) == []
