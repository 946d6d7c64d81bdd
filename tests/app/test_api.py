"""The functions for scripts, and the example that uses them, against loopback vehicles."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import json
import logging
import pickle
import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from typer import testing as runner

import gcsplan
from gcsplan.app import api as scripting
from gcsplan.app import session
from gcsplan.app.api import rehearse, upload, write
from gcsplan.app.fleet import pipeline
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.upload import run as uploads
from gcsplan.cli.command_table import app
from gcsplan.errors import CheckFailed, InputError, UsageError
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mission_file import load, load_mission
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.app.fleet.test_fleet import CROSS
from tests.support.impatient import be_impatient
from tests.support.noted import saying
from tests.support.paths import MISSIONS

EXAMPLE = MISSIONS / "upload_fleet.py"
TEXT = yaml.safe_dump(
    CROSS
    | {
        "limits": CROSS["limits"] | {"track_error_m": 3, "altitude_error_m": 3},
        "arrival": {"mode": "sequence", "order": ["west", "south"], "interval_s": 20, "separation_m": 30},
    }
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


@pytest.fixture(scope="module")
def cross() -> Plan:
    return plan(load_mission("cross.yaml", text=TEXT))


def boards(of: Plan, **trouble: Any) -> list[LoopbackVehicle]:
    return [
        LoopbackVehicle(
            v.mission.sysid, Autopilot.ARDUCOPTER, lat_deg=v.request.start_deg[0], lon_deg=v.request.start_deg[1],
            amsl_m=0.0, misbehave=Misbehaviour(**trouble.get(v.name, {})),
        )
        for v in of.vehicles
    ]  # fmt: skip


def run(code: str) -> str:
    """What a fresh Python prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


NAMES = [
    "check", "clear", "download", "fetch_dem", "load_mission", "new", "plan", "register_optimiser", "register_output",
    "register_planner", "register_zone_reader", "rehearse", "report", "upload", "verify", "write",
]  # fmt: skip


def test_the_functions_are_at_the_front_door_and_cost_nothing_until_used() -> None:
    assert dir(gcsplan) == sorted(gcsplan.__all__)
    assert all(inspect.isclass(getattr(gcsplan, name)) for name in gcsplan.__all__ if name[0].isupper())
    for name in NAMES:
        assert inspect.isfunction(getattr(gcsplan, name))
        assert getattr(gcsplan, name).__doc__
    with pytest.raises(AttributeError, match="uplaod"):
        gcsplan.uplaod  # type: ignore[attr-defined]  # noqa: B018
    code = (
        "import sys, gcsplan; dir(gcsplan); "
        "print(sorted({'numpy', 'pyproj', 'numba', 'pymavlink', 'pydantic'} & set(sys.modules)))"
    )
    assert run(code) == "[]"
    assert (Path(gcsplan.__file__).parent / "py.typed").exists()


@pytest.mark.slow
def test_help_shows_every_function_with_its_arguments() -> None:
    text = run("import pydoc, gcsplan; print(pydoc.render_doc(gcsplan, renderer=pydoc.plaintext))")
    functions = text.split("\nFUNCTIONS")[1]
    shown = [line.split("(")[0] for line in functions.splitlines() if re.match(r"    [a-z_]+\(", line)]
    assert [name.strip() for name in shown] == NAMES


@pytest.mark.slow
@pytest.mark.nightly_but("gcsplan.check.verdict", "gcsplan")
@pytest.mark.parametrize("first", ["gcsplan.check.verdict", "gcsplan.report.page", "gcsplan.cli.main", "gcsplan"])
def test_check_and_report_are_functions_whatever_was_imported_before(first: str) -> None:
    """Packages of the same names stand beside them, and importing one would put it in the function's place."""
    code = (
        f"import {first}; import gcsplan; from gcsplan import check, report; from gcsplan.check.verdict import Verdict"
    )
    assert run(code + "; print(check.__module__, gcsplan.report is report)") == "gcsplan.app.api True"


@pytest.mark.parametrize("module", [load, pipeline, scripting, session], ids=lambda m: m.__name__)
def test_the_examples_in_the_docstrings_run(module: ModuleType) -> None:
    found = doctest.testmod(module)
    assert found.attempted > 1
    assert found.failed == 0


def test_a_mission_is_a_path_a_text_or_a_mapping(tmp_path: Path) -> None:
    file = tmp_path / "cross.yaml"
    file.write_text(TEXT)
    document = yaml.safe_load(TEXT)
    document["vehicles"] = tuple(document["vehicles"])
    document["limits"]["min_agl_m"] = np.float32(document["limits"]["min_agl_m"])
    every = [load_mission(x) for x in (file, str(file), TEXT, document)]
    every += [load_mission(file, text=TEXT), load_mission(text=TEXT)]
    assert {m.path.name for m in every} == {"cross.yaml", "mission.yaml"}
    for m in every:
        assert repr(m.vehicles) == repr(every[0].vehicles)
        assert (m.arrival, m.inputs, m.stem) == (every[0].arrival, every[0].inputs, m.path.stem)


@pytest.mark.parametrize(
    ("source", "text", "words"),
    [
        ("version: 1\nspeed: 3\n", None, "mission: speed: "),
        (CROSS | {"limits": {"min_agl_m": "high"}}, None, r"mission: limits\.min_agl_m: "),
        (CROSS | {"limits": {"min_agl_m": {1, 2}}}, None, r"mission: limits\.min_agl_m: .*given set"),
        (CROSS | {"vehicles": [{1: 2}]}, None, r"mission: vehicles\[0\]: a key is text, given 1"),
        ({}, None, "mission: version: is missing"),
        ("version: 1\n- x", None, "mission: line 2"),
        ("a.yaml", "[]", "a.yaml: a mission file is a mapping"),
        ("no such file.yaml", None, "no such file.yaml: there is no such file"),
    ],
)
def test_what_is_wrong_with_a_mission_is_told_with_its_place(source: Any, text: str | None, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_mission(source, text=text)


def test_what_is_no_mission_at_all_is_a_mistake_of_the_script() -> None:
    for given in ((), (7,)):
        with pytest.raises(UsageError, match="is a path, the text of a mission file, or a mapping"):
            load_mission(*given)
    for source in ("a: 1\n", {"a": 1}):
        with pytest.raises(UsageError, match="load_mission takes"):
            load_mission(source, text="b: 1\n")


def test_a_mapping_that_holds_itself_is_refused() -> None:
    loop: dict[str, Any] = {"version": 1}
    loop["limits"] = loop
    with pytest.raises(InputError, match="levels deep"):
        load_mission(loop)


@pytest.mark.slow
def test_a_plan_a_mission_and_a_file_are_judged_alike(cross: Plan, tmp_path: Path) -> None:
    verdicts = gcsplan.check(cross)
    assert {name: v.legs for name, v in verdicts.items()} == {v.name: v.verdict.legs for v in cross.vehicles}
    write(cross, tmp_path)
    for v in cross.vehicles:
        assert gcsplan.check(v.mission, cross).legs == v.verdict.legs
        for file in (f"{v.name}.waypoints", f"{v.name}.plan"):
            found = gcsplan.check(tmp_path / file, TEXT)
            assert found.safe is True, found.describe()
            assert found.length_m == pytest.approx(v.verdict.length_m, abs=0.01)
    low = dataclasses.replace(cross.vehicles[0].mission, items=lowered(cross.vehicles[0].mission.items))
    assert {f.kind for f in gcsplan.check(low, cross).findings} >= {"min_agl"}
    other = gcsplan.check(tmp_path / "west.plan", cross, vehicle="south")
    assert other.mission.name == "south"
    with pytest.raises(UsageError, match="no vehicle 'nobody'"):
        gcsplan.check(low, cross, vehicle="nobody")
    with pytest.raises(UsageError, match="in which world"):
        gcsplan.check(low)  # type: ignore[call-overload]
    with pytest.raises(UsageError, match="judged whole"):
        gcsplan.check(cross, TEXT)  # type: ignore[call-overload]
    with pytest.raises(InputError, match=r"none\.plan"):
        gcsplan.check(tmp_path / "none.plan", cross, vehicle="west")


@pytest.mark.slow
def test_another_wind_counts_for_a_plan_a_mission_and_a_file(cross: Plan, tmp_path: Path) -> None:
    write(cross, tmp_path)
    wind = {"speed_m_s": 8, "from_deg": 30}
    assert all(v.verdict.arrive_window_s() is None for v in cross.vehicles)
    for name, verdict in gcsplan.check(cross, wind=wind).items():
        mission = next(v.mission for v in cross.vehicles if v.name == name)
        file = gcsplan.check(tmp_path / f"{name}.plan", TEXT, wind=wind)
        for other in (gcsplan.check(mission, cross, wind=wind), file):
            assert other.arrive_window_s() == pytest.approx(verdict.arrive_window_s(), abs=0.01)
            assert other.energy_j == pytest.approx(verdict.energy_j, rel=1e-4)
    assert gcsplan.check(mission, cross, wind={"up_to_m_s": 0}).legs == gcsplan.check(mission, cross).legs
    with pytest.raises(InputError, match="given speed_m_s and up_to_m_s"):
        gcsplan.check(cross, wind=wind | {"up_to_m_s": 3})
    with pytest.raises(UsageError, match=r"wind.*a mapping of the keys of a mission's `wind`"):
        gcsplan.check(cross, wind="5,270")  # type: ignore[call-overload]


def lowered(items: tuple[MissionItem, ...]) -> tuple[MissionItem, ...]:
    return tuple(dataclasses.replace(item, z=min(item.z, 5.0)) for item in items)


@pytest.mark.slow
def test_what_is_written_is_what_the_command_line_writes(cross: Plan, tmp_path: Path) -> None:
    (tmp_path / "cross.yaml").write_text(TEXT)
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "west.plan").write_text("mine")
    written = write(plan(tmp_path / "cross.yaml"), tmp_path / "ours", report=True)
    assert runner.CliRunner().invoke(
        app, ["plan", str(tmp_path / "cross.yaml"), "-o", str(tmp_path / "theirs"), "--report"]
    ).exit_code == 0  # fmt: skip
    assert {file.name for file in written} >= {"west.waypoints", "south.plan", "summary.json", "report.html"}
    theirs = {p.name: p.read_bytes() for p in (tmp_path / "theirs").iterdir()}
    ours = {p.name: p.read_bytes() for p in (tmp_path / "ours").iterdir() if p.is_file()}
    assert ours == theirs
    assert (tmp_path / "ours" / "previous" / "west.plan").read_text() == "mine"


def test_what_does_not_pass_is_not_written_and_retires_what_was_there(cross: Plan, tmp_path: Path) -> None:
    write(cross, tmp_path)
    with pytest.raises(CheckFailed, match="the wind"):
        write(doubtful(cross), tmp_path)
    assert [p.name for p in tmp_path.iterdir() if not p.name.startswith(".")] == ["previous"]
    assert (tmp_path / "previous" / "west.plan").exists()
    assert write(doubtful(cross), tmp_path, allow_unjudged=True)


def doubtful(cross: Plan) -> Plan:
    """One vehicle of it, with something that could not be judged."""
    v = cross.vehicles[0]
    unjudged = dataclasses.replace(v, verdict=type(v.verdict)(v.mission, v.verdict.legs, (), (saying("the wind"),)))
    return dataclasses.replace(cross, vehicles=(unjudged,), fleet=None)


@pytest.mark.slow
def test_a_report_is_text_and_is_written_where_that_is_asked_for(cross: Plan, tmp_path: Path) -> None:
    text = gcsplan.report(cross, tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == text
    assert "west" in text
    with pytest.raises(InputError):
        gcsplan.report(cross, tmp_path / "none" / "page.html", way_home=False)


@pytest.mark.slow
def test_a_plan_is_uploaded_to_one_port_to_a_link_each_and_to_simulated_vehicles(cross: Plan) -> None:
    with SimServer(boards(cross), "udpin:127.0.0.1:0", speedup=10.0) as server:
        done = upload(cross, server.url_for_gcs)
        assert [(d.vehicle, d.verified, d.simulated) for d in done] == [("west", True, False), ("south", True, False)]
        assert all(len(v.items()) > 3 for v in server.vehicles)
    west, south = boards(cross)
    with (
        SimServer([west], "udpin:127.0.0.1:0", speedup=10.0) as one,
        SimServer([south], "udpin:127.0.0.1:0", speedup=10.0) as other,
    ):
        each = upload(cross, {"west": one.url_for_gcs, "south": other.url_for_gcs})
        assert [d.verified for d in each] == [True, True]
        assert each[0].url != each[1].url
    told: list[str] = []
    simulated = upload(cross, "sim", progress=lambda name, progress: told.append(progress.phase))
    assert all(d.simulated and d.verified for d in simulated)
    assert told.count("verified") == 2


@pytest.mark.slow
def test_a_failure_raises_nothing_and_is_told_and_all_or_nothing_takes_back(cross: Plan) -> None:
    with SimServer(boards(cross, south={"refuse": 2}), "udpin:127.0.0.1:0", speedup=10.0) as server:
        west, south = upload(cross, server.url_for_gcs)
        assert (west.verified, south.verified, south.outcome) == (True, False, "refused")
        assert uploads.exit_code([west, south]) == 5
        west, south = upload(cross, server.url_for_gcs, atomic=True)
        assert (west.outcome, south.outcome) == ("withdrawn", "refused")
        assert server.vehicles[0].items()[1:] == ()


def test_what_is_no_target_or_not_safe_is_refused_before_anything_is_sent(cross: Plan) -> None:
    with pytest.raises(UsageError, match="nobody"):
        upload(cross, "nobody=sim")
    with pytest.raises(UsageError, match="link"):
        upload(cross)  # the file has no links
    with pytest.raises(CheckFailed, match="the wind"):
        upload(doubtful(cross), "sim")
    assert upload(doubtful(cross), "sim", allow_unjudged=True)[0].verified


@pytest.mark.slow
def test_a_rehearsal_flies_the_plan_and_finds_its_arrivals(cross: Plan) -> None:
    flown = rehearse(cross)
    assert flown.safe is True, flown.breaches
    assert cross.fleet is not None
    for performance, slot in zip(flown.vehicles, cross.fleet.slots, strict=True):
        assert performance.planned_s == slot.arrive_s
        assert abs(performance.errors_s[0]) < 0.5
    assert flown.order_flown == ("west", "south")
    assert [p.depart_s for p in flown.vehicles] == [s.depart_s for s in cross.fleet.slots]
    assert flown.terms.separation_m == 30
    windy = rehearse(cross, wind_m_s=4.0, noise_m=0.5, runs=3, seed=5)
    assert windy.runs == 3
    assert windy.p95_s is not None


@pytest.mark.slow
def test_the_example_uploads_a_fleet(cross: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "cross.yaml"
    file.write_text(TEXT)
    main = runpy.run_path(str(EXAMPLE))["main"]
    with SimServer(boards(cross), "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert main(str(file), server.url_for_gcs) == 0
        out = capsys.readouterr().out
        assert out.count("verified") == 2
        assert "south: start at T+" in out
    with SimServer(boards(cross, west={"refuse": 2}), "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert main(str(file), server.url_for_gcs) == 5
        assert "withdrawn" in capsys.readouterr().out
    assert main(str(tmp_path / "none.yaml"), "sim") == 2


@pytest.mark.slow
def test_a_plan_survives_pickling_and_gives_the_same_bytes(cross: Plan, tmp_path: Path) -> None:
    again = pickle.loads(pickle.dumps(cross))
    assert {name: v.safe for name, v in gcsplan.check(again).items()} == {v.name: True for v in cross.vehicles}
    for folder, planned in (("here", cross), ("there", again)):
        write(planned, tmp_path / folder, report=True)
    for file in (tmp_path / "here").iterdir():
        assert file.read_bytes() == (tmp_path / "there" / file.name).read_bytes(), file.name
    assert not again.world.airspace.surface.ground_m.flags.writeable


def test_every_result_says_in_one_line_what_it_is(cross: Plan) -> None:
    (one, *_), world = cross.vehicles, cross.world
    shown = [cross, one, cross.source, cross.fleet, one.verdict, one.mission, one.solution, one.problem, one.brief]
    for result in (*shown, world.airspace, world.airspace.surface):
        assert "\n" not in repr(result)
        assert len(repr(result)) < 300, repr(result)[:300]


def test_a_plans_documents_are_those_of_its_files(cross: Plan, tmp_path: Path) -> None:
    write(cross, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    document = json.loads(json.dumps(cross.to_dict()))
    assert {key: document[key] for key in ("schema", "inputs", "fleet")} == {
        key: summary[key] for key in ("schema", "inputs", "fleet")
    }
    assert cross.to_geojson() == json.loads((tmp_path / "mission.geojson").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_mission_on_board_is_verified_downloaded_and_cleared(cross: Plan, tmp_path: Path) -> None:
    one = cross.vehicles[0]
    write(cross, tmp_path)
    with SimServer(boards(cross), "udpin:127.0.0.1:0", speedup=10.0) as server:
        url = server.url_for_gcs
        (sent,) = upload(cross, to={one.name: url})
        assert sent.verified
        sysid = one.mission.sysid
        assert gcsplan.verify(tmp_path / f"{one.name}.plan", url, sysid=sysid).verified
        read = gcsplan.download(url, sysid=sysid)
        assert [(i.command, i.x, i.y) for i in read.items] == [(i.command, i.x, i.y) for i in one.mission.items]
        assert gcsplan.check(read, cross, vehicle=one.name).safe
        assert gcsplan.download(url, tmp_path / "read.plan", sysid=sysid).items == read.items
        gcsplan.clear(url, sysid=sysid)
        assert not gcsplan.verify(tmp_path / f"{one.name}.plan", url, sysid=sysid).verified
    with pytest.raises(UsageError, match="mission, fence or rally"):
        gcsplan.clear("udp:127.0.0.1:1", "everything")


def test_a_new_mission_is_written_once_and_says_what_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    text = gcsplan.new("36.6, -84.3", "36.61, -84.3", flat_m=300.0, file=file)
    assert file.read_text(encoding="utf-8") == text
    for words, given in (
        ("is there already", {"flat_m": 300.0, "file": file}), ("give one of them", {}),
        ("autopilot is one of", {"flat_m": 1.0, "autopilot": "x"}), ("dem: ", {"dem": "no.tif"}),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            gcsplan.new("36.6, -84.3", "36.61, -84.3", **given)
    with pytest.raises(UsageError, match="start is a place"):
        gcsplan.new((36.6, -84.3), "x", flat_m=1.0)  # type: ignore[arg-type]


def test_terrain_that_is_not_named_is_not_fetched() -> None:
    with pytest.raises(UsageError, match="which area"):
        gcsplan.fetch_dem()
    with pytest.raises(UsageError, match="names such as N36W085"):
        gcsplan.fetch_dem(tiles="X", offline=True)


def test_a_plan_logs_its_steps_by_named_loggers_and_sets_none_up(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, logger="gcsplan"):
        plan(load_mission("two.yaml", text=TEXT))
    said = {(r.name, r.levelname) for r in caplog.records}
    assert ("gcsplan.mission_file.load", "INFO") in said
    assert ("gcsplan.planners.optimal.loop.governor", "DEBUG") in said
    assert "two.yaml: 2 vehicles, 0 zones" in caplog.messages
    assert not logging.getLogger("gcsplan").handlers
