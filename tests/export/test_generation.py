"""From one plan to the next in an output directory: killed, interrupted, at once with others, among hostile files."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli import main as cli
from gcsplan.errors import InputError
from gcsplan.export import durable, generation, outdir
from gcsplan.export.durable import PART, locked, write_whole
from gcsplan.export.generation import JOURNAL, STAGE, is_caught
from gcsplan.export.outdir import (
    MANIFEST,
    PREVIOUS,
    require_settled,
    retire_outputs,
    settle_outputs,
    steady,
    write_outputs,
)
from tests.campaigns import crash
from tests.campaigns.disk import workshop
from tests.cli.test_hostile import MISSION, ROWS
from tests.export.test_outdir import FIRST, SECOND, files, tree
from tests.support.paths import REPOSITORY

posix = pytest.mark.skipif(os.name != "posix", reason="needs signals, locks and owners")
as_root = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can be somebody else")


def caught(root: Path, after: int = 3) -> dict[str, bytes | None]:
    """Leave ``root`` as a run does that is killed after so many moves; what it was before."""
    write_outputs(root, FIRST)
    before = tree(root)
    real, count = os.replace, 0

    def replace(source: Path, target: Path) -> None:
        nonlocal count
        real(source, target)
        count += 1
        if count > after:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", replace)
        patch.setattr(generation, "settle", lambda _: False)  # a process that was killed takes nothing back
        with pytest.raises(KeyboardInterrupt):
            write_outputs(root, SECOND)
    assert is_caught(root)
    return before


# -- the campaign -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@posix
def test_a_short_campaign_of_kills_and_power_losses_finds_nothing() -> None:
    command = [sys.executable, "-m", "tests.campaigns.crash", "--seconds", "3", "--seed", "1", "--rounds", "2"]
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert re.fullmatch(r"\d+ directories: (\d+ [a-z ]+(, )?){4}; 0 faults\n", ended.stdout)


def write_over(place: Path) -> crash.World:
    """A directory with a plan and a file of others in the way of the next."""
    root = place / "out"
    write_outputs(root, {name: f"plan p0 {name}".encode() for name in ("uav1.plan", "uav2.plan")})
    (root / "uav3.plan").write_bytes(b"mine")
    before = crash.tree_of(root)
    new = {name: f"plan new {name}".encode() for name in ("uav1.plan", "uav3.plan")}
    write_outputs(root, new)
    after = crash.tree_of(root)
    return crash.World(before, after, lambda out: write_outputs(out, new), Counter([b"mine"]))


@posix
@pytest.mark.slow
@pytest.mark.nightly_but("content", "journal")
@pytest.mark.parametrize("fence", ["content", "stage", "journal", "gone", "end"])
def test_power_losses_find_every_fence_that_is_left_out(fence: str) -> None:
    with workshop() as place:
        of, root = write_over(place), place / "out"
        log = crash.operations(root, of)
        syncs = [i for i, operation in enumerate(log) if operation[0] == "fsync"]
        journal = max(i for i, o in enumerate(log) if o[0] == "write" and o[1].endswith("journal.json.part"))
        begins = next(i for i, o in enumerate(log) if o[0] == "rename" and o[2].endswith("journal.json"))
        comes = next(i for i, o in enumerate(log) if o[0] == "rename" and "/new-" in o[1])
        ends = next(i for i, o in enumerate(log) if o[0] == "remove" and o[1].endswith("journal.json"))
        leaves_out = {
            "content": [i for i in syncs if journal < i and "/new-" in log[i][1]],
            "stage": [i for i in syncs if i < begins and log[i][1] == "."],
            "journal": [next(i for i in syncs if i > begins)],
            "gone": [i for i in syncs if begins < i < comes][1:],
            "end": [next(i for i in syncs if i > ends)],
        }[fence]
        assert leaves_out
        cut = [operation for i, operation in enumerate(log) if i not in leaves_out]
        rng = random.Random(1)
        assert not any(crash.power_losses(root, of, rng, log))
        assert any(found for _ in range(30) for found in crash.power_losses(root, of, rng, cut))


@posix
@pytest.mark.slow
def test_the_campaign_kills_at_every_system_call_that_changes_the_folder(tmp_path: Path) -> None:
    strace = shutil.which("strace")
    if strace is None:
        pytest.skip("strace is not installed")
    step = (
        "import sys\nfrom pathlib import Path\nfrom gcsplan.export.outdir import write_outputs\n"
        "from tests.campaigns import crash\n"
        "def step():\n    write_outputs(sys.argv[1], {'uav1.plan': 'a', 'x.csv': 'b'})\n"
    )
    count = (
        "root = Path(sys.argv[1])\ntree = crash.tree_of(root)\n"
        "def survives(k):\n    crash.put(root, tree)\n    return crash.in_child(crash.killed_before(k, step)) == 0\n"
        "print(next(k for k in range(1000) if survives(k)))\n"
    )
    here, log = tmp_path / "out", tmp_path / "log"
    names = "rename,renameat,renameat2,unlink,unlinkat,mkdir,mkdirat,rmdir,link,linkat,symlink,symlinkat,truncate"
    names += ",ftruncate,write,pwrite64,writev,open,openat,creat,chmod,fchmod,fchmodat,mknod,mknodat"

    def ended(*command: str) -> str:
        run = subprocess.run([*command, str(here)], cwd=REPOSITORY, capture_output=True, text=True, timeout=120)
        if "ptrace" in run.stderr:
            pytest.skip(f"strace may not trace here: {run.stderr[-200:]}")
        assert run.returncode == 0, run.stderr
        return run.stdout

    write_outputs(here, {"uav1.plan": "a", "x.csv": "b"})
    ended(strace, "-f", "-y", "-o", str(log), "-e", f"trace={names}", sys.executable, "-c", f"{step}step()")
    seen = [x for x in log.read_text().splitlines() if str(here) in x and " = -1 " not in x and "resumed" not in x]
    # By the call's name: the path of a test that runs in a worker holds "popen", too.
    calls = [x for x in seen if not re.search(r"^\d+ +open", x) or re.search(r"O_(CREAT|WRONLY|RDWR|TRUNC)", x)]
    assert int(ended(sys.executable, "-c", step + count)) == len(calls), calls


# -- signals ----------------------------------------------------------------------------------------------------------


def heed_signals() -> None:
    """Undo what a child inherits: a shell's background job ignores SIGINT, a command under nohup ignores SIGHUP."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.nightly_but("SIGTERM-143")
@pytest.mark.slow
@posix
@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 143), ("SIGHUP", 129), ("SIGINT", 130)])
def test_a_signal_ends_a_command_with_a_message_and_its_code(tmp_path: Path, number: str, code: int) -> None:
    pipe = tmp_path / "m.yaml"
    os.mkfifo(pipe)
    write_outputs(tmp_path / "out", FIRST)
    before = tree(tmp_path / "out")
    command = [sys.executable, "-m", "gcsplan.cli.main", "plan", str(pipe), "-o", str(tmp_path / "out"), "--json"]
    process = subprocess.Popen(
        command,
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_signals,
    )
    try:
        with pipe.open("w"):  # returns when it is read
            process.send_signal(getattr(signal, number))
            out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == code
    assert json.loads(out)["error"]["code"] == code
    assert err.startswith("gcsplan: ")
    assert err.count("\n") == 1
    assert tree(tmp_path / "out") == before


TERMINATED = """
import os, signal, sys
from gcsplan.cli.process.exit import end_in_good_order
from gcsplan.export import outdir
from tests.export.test_outdir import SECOND
end_in_good_order()
real, count, fatal = os.replace, 0, int(sys.argv[2])
def replace(source, target):
    global count
    real(source, target)
    count += 1
    if count == fatal:
        os.kill(os.getpid(), signal.SIGTERM)
os.replace = replace
try:
    outdir.write_outputs(sys.argv[1], SECOND)
except KeyboardInterrupt:
    sys.exit(9)
sys.exit(0)
"""


@pytest.mark.slow
@posix
@pytest.mark.parametrize("fatal", [1, 3, 6, 9])
def test_sigterm_between_the_moves_takes_them_back(tmp_path: Path, fatal: int) -> None:
    out = tmp_path / "out"
    write_outputs(out, FIRST)
    before = tree(out)
    command = [sys.executable, "-c", TERMINATED, str(out), str(fatal)]
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60, preexec_fn=heed_signals)
    assert (ended.returncode, ended.stderr) == (9, "")
    assert tree(out) == before


# -- a directory that is caught ---------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Iterator[Any]:
    """Call ``gcsplan ARGUMENTS`` in a directory with m.yaml and uav1.waypoints: exit code, standard output, error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(MISSION)
    (tmp_path / "uav1.waypoints").write_text("\n".join(ROWS) + "\n")

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return call


@pytest.mark.nightly
def test_no_command_takes_files_from_a_directory_between_two_plans(run: Any, tmp_path: Path) -> None:
    assert run("plan", "m.yaml", "-o", "out")[0] == 0
    shutil.copy("uav1.waypoints", "out/mine.waypoints")
    caught(tmp_path / "out")
    for arguments in (
        ("check", "m.yaml", "out/uav1.plan"),
        ("check", "m.yaml", "uav1=out/mine.waypoints"),
        ("upload", "out/uav1.plan", "--to", "sim", "--mission", "m.yaml"),
        ("upload", "out/mine.waypoints", "--to", "udpout:127.0.0.1:9", "--unchecked"),
        ("verify", "out/mine.waypoints", "--to", "udpout:127.0.0.1:9"),
    ):
        code, _, err = run(*arguments)
        assert code == 2, arguments
        assert "between two plans" in err, arguments
    assert run("check", "m.yaml", "uav1.waypoints")[0] == 0  # what lies elsewhere is nobody's business
    code, _, err = run("plan", "m.yaml", "-o", "out")
    assert code == 0
    assert "put back" in err
    assert run("check", "m.yaml", "out/uav1.plan")[0] == 0
    assert not (tmp_path / "out" / STAGE).exists()


@pytest.mark.nightly
def test_a_file_that_no_manifest_names_or_that_was_edited_is_checked_as_anybodys(run: Any, tmp_path: Path) -> None:
    assert run("plan", "m.yaml", "-o", ".")[0] == 0
    plan = (tmp_path / "uav1.plan").read_text()
    (tmp_path / "uav1.plan").write_text(plan + " ")
    (tmp_path / "other.plan").write_text(plan)
    assert run("check", "m.yaml", "uav1.plan", "uav1=other.plan")[0] == 0
    (tmp_path / MANIFEST).unlink()
    assert run("check", "m.yaml", "uav1.plan")[0] == 0


@pytest.mark.parametrize("after", range(9))
def test_what_people_put_into_a_caught_directory_stays(tmp_path: Path, after: int) -> None:
    out = tmp_path / "out"
    before = caught(out, after)
    for name in (*FIRST, *SECOND, MANIFEST):
        (out / name).write_text(f"mine, {name}")
    assert settle_outputs(out)
    held = files(out)
    assert {name: (out / name).read_text() for name in (*FIRST, *SECOND)} == {
        name: f"mine, {name}" for name in (*FIRST, *SECOND)
    }
    # What could not come back to its place, and was ours, is kept beside it.
    left = [c for n, c in before.items() if c is not None and n != MANIFEST and not (out / n).exists()]
    assert all(c in held.values() for c in left)
    write_outputs(out, SECOND)
    assert {n: c for n, c in files(out).items() if "/" not in n} == {n: c.encode() for n, c in SECOND.items()}
    assert {f"mine, {name}".encode() for name in SECOND} <= set(files(out).values())


def test_reading_is_refused_where_a_plan_is_written_meanwhile(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    with steady([tmp_path / "uav1.plan"]):
        write_outputs(tmp_path.parent / "elsewhere", SECOND)
    with pytest.raises(InputError, match="while they were read"), steady([tmp_path / "uav1.plan"]):
        write_outputs(tmp_path, SECOND)
    with pytest.raises(InputError, match="no such file"), steady([tmp_path / "x"]):
        raise InputError("there is no such file")
    require_settled([tmp_path / "\0", tmp_path / ("x" * 5000) / "y"])


@pytest.mark.parametrize(
    "journal",
    [
        b"", b"{", b"[" * 100_000, b"3", b'{"version": 2, "leaving": [], "coming": [], "digests": {}}',
        b'{"version": 1, "leaving": [["../victim", "previous/x"]], "coming": [], "digests": {}, "makes_previous": 0}',
        b'{"version": 1, "leaving": [], "coming": [["a", "/etc/b"]], "digests": {}, "makes_previous": false}',
        b'{"version": 1, "leaving": [["previous/../../victim", "a"]], "coming": [], "digests": {}}',
    ],
)  # fmt: skip
def test_a_journal_that_is_none_of_ours_moves_nothing(tmp_path: Path, journal: bytes) -> None:
    out = tmp_path / "out"
    (out / STAGE).mkdir(parents=True)
    (out / STAGE / JOURNAL).write_bytes(journal)
    (tmp_path / "victim").write_text("mine")
    (out / PREVIOUS).mkdir()
    (out / PREVIOUS / "x").write_text("mine")
    before = tree(tmp_path)
    for action in (lambda: write_outputs(out, FIRST), lambda: settle_outputs(out), lambda: retire_outputs(out)):
        with pytest.raises(InputError, match="cannot be read"):
            action()
    assert tree(tmp_path) == before


@pytest.mark.parametrize("place", ["file", "link", "theirs"])
def test_what_stands_in_the_place_of_the_stage_is_named_and_left(tmp_path: Path, place: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    if place == "file":
        (out / STAGE).write_text("mine")
    elif place == "link":
        (tmp_path / "elsewhere").mkdir()
        (out / STAGE).symlink_to(tmp_path / "elsewhere")
    else:
        (out / STAGE).mkdir()
        (out / STAGE / "diary").write_text("mine")
    before = tree(tmp_path)
    with pytest.raises(InputError, match=re.escape(STAGE)):
        write_outputs(out, FIRST)
    assert tree(tmp_path) == before


def test_what_a_run_left_that_was_killed_before_its_journal_is_swept_away(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    (tmp_path / STAGE).mkdir()
    (tmp_path / STAGE / "new-0").write_text("half")
    (tmp_path / STAGE / f"{JOURNAL}.part").write_text("{")
    require_settled([tmp_path / "uav1.plan"])
    write_outputs(tmp_path, SECOND)
    assert files(tmp_path) == {name: c.encode() for name, c in SECOND.items()}


# -- at once, and as somebody else ------------------------------------------------------------------------------------


@posix
def test_a_run_waits_for_another_and_then_gives_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(durable, "LOCK_WAIT_S", 0.1)
    write_outputs(tmp_path, FIRST)
    before = tree(tmp_path)
    with locked(tmp_path):
        for action in (lambda: write_outputs(tmp_path, SECOND), lambda: retire_outputs(tmp_path)):
            with pytest.raises(InputError, match="another gcsplan has been writing here"):
                action()
    assert tree(tmp_path) == before
    monkeypatch.setattr(durable, "LOCK_WAIT_S", 30.0)
    ended: list[list[str]] = []
    with locked(tmp_path):
        waiting = threading.Thread(target=lambda: ended.append(write_outputs(tmp_path, SECOND)))
        waiting.start()
        waiting.join(0.1)
        assert not ended
    waiting.join(30.0)
    assert ended == [[]]


AS_NOBODY = """
import os, sys
from gcsplan.errors import InputError
from gcsplan.export.outdir import retire_outputs, settle_outputs, write_outputs, write_whole
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
out = sys.argv[1]
for action in (
    lambda: write_outputs(out, {"uav1.plan": "new"}), lambda: write_outputs(out + "/deeper", {"uav1.plan": "new"}),
    lambda: retire_outputs(out), lambda: settle_outputs(out), lambda: write_whole(out + "/x.plan", "new"),
):
    try:
        print(action())
    except InputError as error:
        print("refused:", error)
"""


@pytest.mark.slow
@as_root
@pytest.mark.parametrize("mode", [0o755, 0o700, 0o1777])
@pytest.mark.parametrize("state", ["whole", "caught", "half"])
def test_somebody_elses_directory_is_refused_in_words_and_left_as_it_is(mode: int, state: str) -> None:
    with tempfile.TemporaryDirectory() as place:
        os.chmod(place, 0o755)
        out = Path(place) / "out"
        write_outputs(out, {"uav1.plan": "old"})
        if state == "caught":
            caught(out)
        elif state == "half":
            (out / STAGE).mkdir()
        out.chmod(mode)
        before = tree(out)
        command = [sys.executable, "-c", AS_NOBODY, str(out)]
        ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
        assert ended.returncode == 0, ended.stderr
        said = ended.stdout.splitlines()
        now = tree(out)
        if mode == 0o1777:  # anybody may add files there, but move nobody else's
            assert before.items() <= now.items()
            assert set(now) - set(before) <= {"x.plan", "deeper", f"deeper/{MANIFEST}", "deeper/uav1.plan"}
        else:
            assert now == before
            assert all(said[k].startswith("refused:") for k in (0, 1, 4))
        assert not any("Traceback" in line for line in said)


# -- single files -----------------------------------------------------------------------------------------------------


@posix
def test_what_killed_writers_left_is_swept_and_what_living_ones_write_is_not(tmp_path: Path) -> None:
    dead = tmp_path / f"{PART}{'0' * 16}"
    dead.write_text("half")
    (tmp_path / f"{PART}notes").write_text("mine")
    handle, living = durable.new_part(tmp_path)
    write_whole(tmp_path / "x.plan", "whole")
    assert files(tmp_path) == {"x.plan": b"whole", living.name: b"", f"{PART}notes": b"mine"}
    os.close(handle)
    write_whole(tmp_path / "x.plan", "again")
    assert files(tmp_path) == {"x.plan": b"again", f"{PART}notes": b"mine"}


def test_a_file_has_the_mode_of_any_other(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "x", "1")
        write_outputs(tmp_path / "out", FIRST)
    finally:
        os.umask(before)
    if os.name == "posix":
        assert (tmp_path / "x").stat().st_mode & 0o777 == 0o640
        assert (tmp_path / "out" / "uav1.plan").stat().st_mode & 0o777 == 0o640


@posix
def test_a_pipe_or_device_keeps_its_place(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for target in (pipe, tmp_path / "link"):
        if target != pipe:
            target.symlink_to(os.devnull)
        with pytest.raises(InputError, match="cannot be written: it is a device or a pipe"):
            write_whole(target, "report")
    assert pipe.is_fifo()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link", "pipe"]


def test_two_names_that_are_one_on_this_disk_are_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_outputs(tmp_path, {"UAV1.plan": "old"})
    write_outputs(tmp_path, {"uav1.plan": "new"})
    assert files(tmp_path) == {"uav1.plan": b"new"}
    assert outdir.can_hold(tmp_path, tmp_path / "x.png")
    assert not outdir.can_hold(tmp_path, tmp_path / "x y.png")
    assert not outdir.can_hold(tmp_path, tmp_path.parent / "x.png")
