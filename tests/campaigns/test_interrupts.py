"""A short run of the campaign `interrupts`, and what it counts as a fault."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns import interrupts
from tests.campaigns.interrupts import Case, End, wrong_end, wrong_files
from tests.support.paths import REPOSITORY

linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes as Linux shows them")


@pytest.mark.nightly
@linux
@pytest.mark.parametrize("kind", list(interrupts.KINDS))
def test_a_short_campaign_of_signals_finds_nothing(kind: str) -> None:
    words = ["--seconds", "60", "--rounds", "3", "--kinds", kind]
    command = [sys.executable, "-m", "tests.campaigns.interrupts", *words]
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert re.match(r"\d rounds, 0 faults, ", ended.stdout)


def ended(code: int) -> str:
    return json.dumps({"error": {"code": code}})


def test_a_stopped_command_owes_one_message_and_its_code() -> None:
    def end(code: int, out: str, err: str) -> End:
        return End(signal.SIGTERM, code, out, err, 0.1)

    assert wrong_end(end(143, ended(143), "gcsplan: terminated\n"), 0) == []
    assert wrong_end(end(0, "{}", ""), 0) == []
    assert wrong_end(end(-15, "", ""), 0) == []
    assert wrong_end(end(143, '{"schema": 1, "vehi', "gcsplan: terminated\n"), 0) == []  # cut off while it was printed
    for code, out, err in (
        (130, ended(130), "gcsplan: interrupted\n"), (143, "", "gcsplan: terminated\n"), (143, ended(143), ""),
        (143, ended(143), "Traceback (most recent call last): gcsplan"), (70, ended(70), "gcsplan: internal error\n"),
        (143, ended(143) * 2, "gcsplan: terminated\n"), (-15, "{", ""), (4, "{}", ""),
    ):  # fmt: skip
        assert wrong_end(end(code, out, err), 0), (code, out, err)


def test_what_may_be_left(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    one = Case(["plan"], tmp_path, "out", before={"a": b"1"}, after={"a": b"2", "b": b"3"})
    many = Case(["batch"], tmp_path, "out", steps=True, after={"m/a": b"2", "m/b": b"3"})

    def left(case: Case, **files: bytes) -> list[str]:
        case.put_back()
        for name, content in files.items():
            file = tmp_path / "out" / name.replace("_", "/")
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(content)
        return wrong_files(case)

    assert left(one) == []
    assert left(one, a=b"2", b=b"3") == []
    assert left(one, a=b"2")
    assert left(one, **{".gcsplan-part-1": b""})
    assert left(many) == []
    assert left(many, m_a=b"2", m_b=b"3") == []
    assert left(many, m_a=b"2")
    assert left(many, m_a=b"1", m_b=b"3")


@linux
def test_processes_that_are_left_are_seen() -> None:
    with subprocess.Popen(["sleep", "60"], start_new_session=True) as process:
        assert interrupts.left_over(process.pid) == [process.pid]
        process.kill()
