"""Typical mistakes of newcomers: each ends in one message, and the change that it tells leads to a plan.

Each file of tests/data/mistakes is a mission with one mistake. Lines that begin with ``#:`` are for this test: the exit
code, the whole message (``<...>`` stands for any words), and the change that the message tells, as in a diff. Files
that missions name are in the folder beside.
"""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from gcsplan.app.fleet import pipeline
from gcsplan.app.fleet.may_fly import require_passing
from gcsplan.cli.main import main
from tests.support.paths import DATA

FOLDER = DATA / "mistakes"
FILES = sorted(FOLDER.glob("*.yaml"))
QUICK = {"start-swapped", "vehicle-instead-of-vehicles", "zone-file-not-there", "max-amsl-below-ground"}
"""Those that the quick suite mends, too; of the messages it looks at every third."""


@dataclass(frozen=True)
class Mistake:
    """One file: the mission with its mistake, what is said of it, and the changes (old lines, new lines)."""

    mission: str
    code: int
    says: str
    changes: tuple[tuple[str, str], ...]

    @property
    def mended(self) -> str:
        """The mission after the changes, each of which has one place in it."""
        text = self.mission
        for old, new in self.changes:
            assert ("\n" + text).count("\n" + old) == 1, old
            text = ("\n" + text).replace("\n" + old, "\n" + new).removeprefix("\n")
        return text


def read(file: Path) -> Mistake:
    mission, _, rest = file.read_text(encoding="utf-8").partition("#: ")
    lines = ("#: " + rest).splitlines()
    code, says = lines[0].removeprefix("#: exit "), lines[1].removeprefix("#: says ")
    changes: list[tuple[str, str]] = []
    for line in lines[2:]:
        sign, words = line[3], line[4:] + "\n"
        if sign == "-" and (not changes or changes[-1][1]):
            changes.append(("", ""))
        old, new = changes[-1]
        changes[-1] = (old + words, new) if sign == "-" else (old, new + words)
    return Mistake(mission, int(code), says, tuple(changes))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(FOLDER / "beside", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


def test_there_are_sixty_and_more() -> None:
    assert len(FILES) >= 60


@pytest.mark.parametrize(
    "file", [pytest.param(f, marks=[pytest.mark.slow] if i % 3 else [], id=f.stem) for i, f in enumerate(FILES)]
)
def test_a_mistake_ends_in_one_message_and_nothing_is_written(
    file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    mistake = read(file)
    (folder / "mission.yaml").write_text(mistake.mission, encoding="utf-8")
    before = files_of(folder)
    monkeypatch.setattr(sys, "argv", ["gcsplan", "plan", "mission.yaml"])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capfd.readouterr()
    wanted = ".+".join(re.escape(part) for part in f"gcsplan: {mistake.says}\n".split("<...>"))
    assert re.fullmatch(wanted, err), err
    assert err.count("\n") == 1
    assert (ended.value.code, out) == (mistake.code, "")
    assert files_of(folder) == before


@pytest.mark.nightly_but(
    "clearance-misspelt",
    "climb-of-zero",
    "max-amsl-below-ground",
    "start-swapped",
    "vehicle-instead-of-vehicles",
    "zone-file-not-there",
)
@pytest.mark.parametrize(
    "file", [pytest.param(f, marks=[] if f.stem in QUICK else pytest.mark.slow, id=f.stem) for f in FILES]
)
def test_what_the_message_tells_leads_to_a_plan(file: Path, folder: Path) -> None:
    mistake = read(file)
    assert mistake.changes
    assert mistake.mended != mistake.mission
    (folder / "mission.yaml").write_text(mistake.mended, encoding="utf-8")
    planned = pipeline.plan(pipeline.load_mission(Path("mission.yaml")))
    require_passing({v.name: v.verdict for v in planned.vehicles}, allow_unjudged=False)
