"""`gcsplan check` of anybody's files: every planted violation is found, no clean file is called unsafe."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.check.files import Batch, check_at, finding_lines
from gcsplan.app.check.worlds import OptionsSite, VerdictParts
from gcsplan.cli import main as cli
from gcsplan.errors import InputError
from gcsplan.mission_file.options_world import WorldOptions
from gcsplan.notes.note import TEXTS, fields_of
from gcsplan.vehicle import Autopilot
from tests.support import corpus
from tests.support.corpus import Case
from tests.support.shown import seconds


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("corpus")


@pytest.fixture(scope="module")
def options(folder: Path) -> WorldOptions:
    dem, zones = corpus.write_world(folder)
    return WorldOptions(
        {"dem": [dem], "vertical_datum": "EGM96"}, (zones,), corpus.OPTIONS, rtl_rel_home_m=corpus.RTL_M
    )


def judged(batch: Batch) -> dict[str, Any]:
    assert batch.unreadable == ()
    return {str(c.file): c for c in batch.checked}


def with_options(options: WorldOptions, autopilot: Autopilot | None, arguments: list[str]) -> Batch:
    return check_at(OptionsSite(options, autopilot), "check", arguments, VerdictParts())


def compare_with(case: Case, checked: Any) -> str:
    """What is amiss with a verdict; empty if it is as planted."""
    verdict = checked.verdict
    first = checked.mission.first_seq
    kinds = {f.kind for f in verdict.findings}
    at = {f.seq - first for f in verdict.findings}
    if not case.kinds:
        return "" if verdict.safe is True else f"{checked.file} is clean:\n{verdict.describe()}"
    if verdict.safe is not False or not kinds or not kinds <= case.kinds:
        return f"{checked.file} has {set(case.kinds)} planted:\n{verdict.describe() or 'nothing was found'}"
    return "" if at <= case.at else f"{checked.file}: items {set(case.at)} are at fault, found at {at}"


def amiss(written: dict[str, Case], batch: Batch) -> list[str]:
    found = judged(batch)
    assert set(found) == set(written)
    return [words for file, case in written.items() if (words := compare_with(case, found[file]))]


@pytest.mark.nightly
def test_files_with_a_home_are_judged_as_planted(folder: Path, options: WorldOptions) -> None:
    written = corpus.write(folder, corpus.WITH_HOME)
    assert len(written) > 100
    assert amiss(written, with_options(options, Autopilot.ARDUCOPTER, list(written))) == []


@pytest.mark.slow
def test_files_without_a_home_are_judged_with_the_one_that_is_given(folder: Path, options: WorldOptions) -> None:
    written = corpus.write(folder, corpus.WITHOUT_HOME)
    given = WorldOptions(
        options.terrain, options.zones, options.limits, home=corpus.degrees(*corpus.HOME), rtl_rel_home_m=corpus.RTL_M
    )
    assert amiss(written, with_options(given, Autopilot.ARDUCOPTER, list(written))) == []
    batch = with_options(options, Autopilot.ARDUCOPTER, list(written))
    assert batch.checked == ()
    assert all("home" in error.message for _, error in batch.unreadable)


@pytest.mark.nightly
def test_plans_for_px4_are_judged_as_planted(folder: Path, options: WorldOptions) -> None:
    written = corpus.write(folder, corpus.PX4)
    assert amiss(written, with_options(options, None, list(written))) == []


@pytest.mark.slow
def test_the_place_of_a_violation_is_where_it_was_planted(folder: Path, options: WorldOptions) -> None:
    written = corpus.write(folder, {"qgc": corpus.WITH_HOME["qgc"]})
    files = {case.name: file for file, case in written.items()}
    names = ["hill_between", "through_zone", "jump_through_zone", "circle_into_zone"]
    found = judged(with_options(options, Autopilot.ARDUCOPTER, [files[n] for n in names]))

    def place(name: str) -> tuple[float, float]:
        (finding, *_) = found[files[name]].verdict.findings
        return (finding.lon_deg - corpus.LON) * corpus.EAST_M, (finding.lat_deg - corpus.LAT) * corpus.NORTH_M

    assert place("hill_between") == pytest.approx((0, 0), abs=60)
    assert place("through_zone") == pytest.approx((2500, 0), abs=60)
    assert place("jump_through_zone") == pytest.approx((2500, 0), abs=60)
    (jumped,) = found[files["jump_through_zone"]].verdict.findings
    assert "after the jump at item 7" in jumped.message
    assert jumped.zone == "tower"


def test_the_nearest_misses_are_told_for_every_limit(folder: Path, options: WorldOptions) -> None:
    written = corpus.write(folder, {"qgc": corpus.WITH_HOME["qgc"]})
    file = next(f for f, case in written.items() if case.name == "round")
    (checked,) = with_options(options, Autopilot.ARDUCOPTER, [file]).checked
    misses = {miss.kind: miss for miss in checked.verdict.misses if miss.zone != "wood"}
    assert set(misses) >= {"min_agl", "max_amsl", "terrain_clearance", "zone", "climb"}
    assert misses["min_agl"].room == pytest.approx(100 - 60 - 5, abs=0.1)
    assert misses["max_amsl"].room == pytest.approx(750 - 5 - 520, abs=0.1)
    assert misses["zone"].zone == "tower"
    # From (2500, -1000) to (4000, 0) the leg passes the tower's middle at a distance of 832 m.
    assert misses["zone"].value == pytest.approx(832.0 - 200.0, abs=2.0)
    assert misses["zone"].room == pytest.approx(misses["zone"].value - 33.0, abs=0.1)
    assert all(miss.room > 0 for miss in misses.values())
    for miss in misses.values():
        assert abs(miss.lat_deg - corpus.LAT) < corpus.HALF_DEG


def test_what_is_not_judged_is_named(folder: Path, options: WorldOptions) -> None:
    strange = (*corpus.cases()[0].items[:3], corpus.to(0, -2500, 120.0, 31000), *corpus.cases()[0].items[3:])
    file = folder / "strange.waypoints"
    file.write_text(corpus.qgroundcontrol(strange))
    (checked,) = with_options(options, Autopilot.ARDUCOPTER, [str(file)]).checked
    assert checked.verdict.safe is None
    (line,) = finding_lines(checked)
    assert line.startswith(f"{file}:4: not_judged: ")
    assert finding_lines(checked, allow_unjudged=True) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"terrain": {"dem": ["nowhere.tif"]}}, "--dem"),
        ({"terrain": {"dem": [], "vertical_datum": "EGM96"}}, "--dem"),
        ({"limits": {"min_agl_m": -5.0}}, "--min-agl"),
        ({"limits": {"min_agl_m": 60.0, "max_agl_m": 50.0}}, "--min-agl"),
        ({"limits": {"min_agl_m": 60.0, "max_climb_deg": 100.0}}, "--max-climb"),
        ({"vehicle": {"speed_m_s": [0.0, 0.0]}}, "--speed"),
        ({"zones": ("nowhere.geojson",)}, "--zones"),
    ],
)
def test_an_option_that_is_off_is_named(options: WorldOptions, change: dict[str, Any], said: str) -> None:
    off = WorldOptions(**({"terrain": options.terrain, "zones": options.zones, "limits": options.limits} | change))
    with pytest.raises(InputError) as refused:
        with_options(off, None, [])
    assert said in str(refused.value)


@pytest.mark.slow
def test_a_zone_that_is_under_ground_here_and_reaches_far_beyond_is_no_mistake(
    folder: Path, options: WorldOptions
) -> None:
    def zone(half_deg: float) -> str:
        ring = [[8 + x * half_deg, 47 + y * half_deg] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))]
        feature = {"type": "Feature", "properties": {"name": "low", "ceiling_amsl_m": 300.0}}
        file = folder / "low.geojson"
        file.write_text(json.dumps(feature | {"geometry": {"type": "Polygon", "coordinates": [ring]}}))
        return str(file)

    (name,) = (f for f, c in corpus.write(folder, {"qgc": corpus.WITH_HOME["qgc"]}).items() if c.name == "round")
    far = WorldOptions(options.terrain, (zone(2.0),), options.limits)
    (checked,) = with_options(far, Autopilot.ARDUCOPTER, [name]).checked
    assert checked.verdict.safe is True
    with pytest.raises(InputError, match="under ground"):
        with_options(WorldOptions(options.terrain, (zone(0.01),), options.limits), Autopilot.ARDUCOPTER, [name])


# -- the command --------------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Any:
    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", "check", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return call


@pytest.fixture(scope="module")
def world(folder: Path) -> list[str]:
    dem, zones = corpus.write_world(folder)
    return ["--dem", dem, "--vertical-datum", "EGM96", "--zones", zones, "--min-agl", "60", "--max-amsl", "750"]


def file_of(folder: Path, name: str, manner: str = "plan") -> str:
    written = corpus.write(folder, {manner: corpus.WITH_HOME[manner]})
    return next(f for f, case in written.items() if case.name == name)


@pytest.mark.slow
def test_quiet_says_nothing_of_what_passes_and_one_line_of_each_finding(
    run: Any, folder: Path, world: list[str]
) -> None:
    good, bad = file_of(folder, "round"), file_of(folder, "through_zone")
    assert run(good, *world, "-q") == (0, "", "")
    code, out, err = run(good, bad, *world, "-q")
    assert (code, err) == (4, "")
    (line,) = out.splitlines()
    assert line.startswith(f"{bad}:5: zone: inside no-fly zone “tower”")


@pytest.mark.slow
def test_a_table_the_nearest_misses_and_a_profile_are_shown(run: Any, folder: Path, world: list[str]) -> None:
    code, out, err = run(file_of(folder, "round"), *world)
    assert code == 0
    for words in ("safe", "lowest above ground", "nearest to zone tower", "to spare", "m AMSL", "█", "•"):
        assert words in out
    assert "UNSAFE" not in out
    assert all(line.startswith("note: ") for line in err.splitlines())


def rows_of(table: str) -> list[list[str]]:
    """The cells of the rows that begin with an item's number."""
    return [
        line.replace("\u2009", "").split()
        for line in table.splitlines()
        if re.match(r" *\d+ +(takeoff|cruise|land|loiter|rtl) ", line)
    ]


@pytest.mark.slow
def test_a_spline_is_one_row_however_many_chords_it_has(run: Any, folder: Path, world: list[str]) -> None:
    file = file_of(folder, "spline")
    _, out, _ = run(file, *world, "--json")
    (verdict,) = json.loads(out)["verdicts"]
    seqs = [leg["seq"] for leg in verdict["legs"]]
    spline = max(seqs, key=seqs.count)
    chords = [leg for leg in verdict["legs"] if leg["seq"] == spline]
    assert len(chords) > 10
    _, out, _ = run(file, *world)
    rows = rows_of(out)
    assert [int(row[0]) for row in rows] == list(dict.fromkeys(seqs))
    row = next(row for row in rows if int(row[0]) == spline)
    assert float(row[2]) == pytest.approx(sum(leg["length_m"] for leg in chords), abs=0.51)
    assert float(row[5]) == pytest.approx(min(leg["min_agl_m"] for leg in chords), abs=0.11)
    assert seconds(row[-1]) == pytest.approx(sum(leg["time_s"] for leg in chords), abs=0.51)


@pytest.mark.slow
def test_findings_stand_before_the_table(run: Any, folder: Path, world: list[str]) -> None:
    code, out, _ = run(file_of(folder, "through_zone"), *world)
    assert code == 4
    lines = out.splitlines()
    finding = next(k for k, line in enumerate(lines) if "inside no-fly zone" in line)
    head = next(k for k, line in enumerate(lines) if "leg m" in line)
    assert lines[0].endswith("path UNSAFE, return not judged")
    assert 0 < finding < head
    assert out.count("UNSAFE") == 1


@pytest.mark.slow
def test_json_holds_every_leg_and_miss_with_places_to_a_centimetre(run: Any, folder: Path, world: list[str]) -> None:
    code, out, _ = run(file_of(folder, "through_zone"), *world, "--json")
    document = json.loads(out)
    assert code == document["error"]["code"] == 4
    (verdict,) = document["verdicts"]
    assert verdict["safe"] is False
    assert {miss["kind"] for miss in verdict["nearest_misses"]} >= {"min_agl", "max_amsl", "zone"}
    assert len(verdict["legs"]) == 8
    (violation,) = verdict["violations"]
    assert (violation["zone"], violation["lon_deg"]) == ("tower", pytest.approx(8.0328707, abs=1e-4))
    assert verdict["nearest_misses"][0]["lat_deg"] != round(verdict["nearest_misses"][0]["lat_deg"], 4)
    assert document["inputs"]["vertical_datum"] == "EGM96"


@pytest.mark.slow
def test_a_file_that_cannot_be_read_is_exit_2_unless_another_is_worse(run: Any, folder: Path, world: list[str]) -> None:
    broken = folder / "broken.plan"
    broken.write_text("{}")
    code, out, err = run(broken, file_of(folder, "through_zone"), *world, "-q")
    assert code == 4
    assert "broken.plan" in err
    assert "tower" in out
    assert run(broken, file_of(folder, "round"), *world, "-q")[0] == 2
    code, out, _ = run(broken, *world, "--json")
    assert code == 2
    assert json.loads(out)["error"]["problems"]


def test_a_zone_with_latitude_and_longitude_swapped_is_refused_and_not_left_out(
    run: Any, folder: Path, world: list[str]
) -> None:
    lat, lon = corpus.degrees(*corpus.HOME)
    point = {"type": "Point", "coordinates": [lat, lon]}  # GeoJSON has the longitude first
    feature = {"type": "Feature", "properties": {"name": "mast", "radius_m": 60}, "geometry": point}
    zones = folder / "swapped.geojson"
    zones.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    code, _, err = run(file_of(folder, "round"), *world, "--zones", zones, "-q")
    assert code == 2
    assert "latitude and longitude of the zone 'mast' look swapped" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["x.plan"], "--dem and --min-agl"),
        (["x.plan", "--dem", "y.tif"], "--min-agl"),
        (["x.yaml"], "which files"),
        (["x.yaml", "x.plan", "--min-agl", "60"], "the mission file says that"),
        (["x.plan", "--dem", "y.tif", "--min-agl", "60", "--home", "somewhere"], "--home somewhere"),
        (["x.plan", "--dem", "y.tif", "--min-agl", "60", "--autopilot", "paper"], "arducopter"),
        (["x.plan", "--dem", "y.tif", "--min-agl", "60", "--report", "x.pdf"], ".html"),
    ],
)
def test_wrong_usage_is_explained(run: Any, arguments: list[str], said: str) -> None:
    code, _, err = run(*arguments)
    assert code == 2
    assert said in err


@pytest.mark.slow
@pytest.mark.parametrize("far", [(36.6, 177.0), (0.0, 5.6), (-36.6, 95.6), (38.6, -84.3)])
def test_a_spline_to_the_other_end_of_the_world_is_a_finding_and_asks_for_no_terrain(
    run: Any, folder: Path, world: list[str], far: tuple[float, float]
) -> None:
    plan = json.loads(Path(file_of(folder, "spline")).read_text())
    item = next(i for i in plan["mission"]["items"] if i["command"] == 82)
    item["params"][4:6] = far
    file = folder / "far.plan"
    file.write_text(json.dumps(plan))
    code, out, err = run(file, *world, "-q")
    assert code == 4
    assert "too far from the mission's terrain" in out
    assert "Warning" not in err


@pytest.mark.slow
def test_a_mission_files_world_reaches_as_far_as_the_file_flies(run: Any, folder: Path, world: list[str]) -> None:
    # The mission itself stays in one corner; the file goes round the whole terrain.
    lat, lon = corpus.degrees(*corpus.HOME)
    near_lat, near_lon = corpus.degrees(-3900, -1900)
    mission = folder / "corner.yaml"
    mission.write_text(
        f"""
version: 1
terrain: {{dem: dem.tif, vertical_datum: EGM96}}
limits: {{min_agl_m: 60, max_amsl_m: 750, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5}}
no_fly: [{{file: zones.geojson}}]
vehicles:
  - {{name: uav1, sysid: 1, autopilot: arducopter, start: [{lat}, {lon}], goal: [{near_lat}, {near_lon}]}}
"""
    )
    assert run(mission, file_of(folder, "round"), "-q") == (0, "", "")
    code, out, _ = run(mission, file_of(folder, "outside"), "-q")
    assert code == 4
    assert "does not know" in out


@pytest.mark.slow
def test_a_file_in_terrain_frame_is_judged_with_the_terrain_error_in_any_mission(
    run: Any, folder: Path, world: list[str]
) -> None:
    lat, lon = corpus.degrees(*corpus.HOME)
    mission = folder / "relative.yaml"
    mission.write_text(
        f"""
version: 1
terrain: {{dem: dem.tif, vertical_datum: EGM96}}
limits: {{min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5}}
vehicles:
  - {{name: uav1, sysid: 1, autopilot: arducopter, start: [{lat}, {lon}], goal: [{lat}, {lon}]}}
"""
    )
    assert run(mission, file_of(folder, "above_terrain"), "-q")[0] == 0
    code, out, _ = run(mission, file_of(folder, "low_above_terrain"), "-q")  # 90 m, less 30 m and 5 m
    assert code == 4
    assert "min_agl" in out


@pytest.mark.nightly
def test_the_way_home_is_judged_where_that_is_asked_for(run: Any, folder: Path, world: list[str]) -> None:
    file = file_of(folder, "round")  # from the east the hill stands in the way home
    assert run(file, *world, "--rtl-altitude", "120", "-q")[0] == 0
    code, out, _ = run(file, *world, "--rtl-altitude", "120", "--way-home", "-q")
    assert code == 0
    [line] = out.splitlines()
    assert ": warning: way_home: path safe; no safe return from " in line
    code, out, _ = run(file, *world, "--rtl-altitude", "120", "--require-way-home", "-q")
    assert code == 4
    assert all(": way_home: " in line for line in out.splitlines())
    bare = world[:4] + world[6:]  # without zones: the tower has no top
    assert run(file, *bare, "--rtl-altitude", "345", "--way-home", "-q") == (0, "", "")
    _, out, _ = run(file, *world, "--rtl-altitude", "120", "--way-home", "--json")
    document = json.loads(out)
    assert document["verdicts"][0]["way_home"]["safe"] is False
    assert "error" not in document
    _, out, _ = run(file, *world, "--rtl-altitude", "120", "--require-way-home", "--json")
    assert "way_home" in json.loads(out)["error"]["message"]


@pytest.mark.parametrize("altitude", ["nan", "inf", "-inf", "1e300"])
def test_a_return_altitude_that_is_none_is_refused_not_safe(run: Any, world: list[str], altitude: str) -> None:
    code, out, err = run("round.waypoints", *world, "--rtl-altitude", altitude, "--require-way-home", "-q")
    assert (code, out) == (2, "")
    assert "--rtl-altitude: must be " in err


def said_and_data(value: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every sentence of a document that has its data beside it, with them."""
    if isinstance(value, dict):
        for key, said in value.items():
            if f"{key}_data" in value:
                data = value[f"{key}_data"]
                pairs = zip(said, data, strict=True) if isinstance(said, list) else [(said, data)]
                yield from ((sentence, of) for sentence, of in pairs if of is not None)
        if "message" in value and "seq" in value:
            yield value["message"], value
        for each in value.values():
            yield from said_and_data(each)
    elif isinstance(value, list):
        for each in value:
            yield from said_and_data(each)


@pytest.mark.nightly_but("--json-lines")
@pytest.mark.slow
@pytest.mark.parametrize("form", ["--json", "--json-lines"])
def test_each_sentence_of_json_has_its_code_and_data(run: Any, folder: Path, world: list[str], form: str) -> None:
    files = [file_of(folder, name) for name in ("round", "jump_for_ever", "low_take_off")]
    _, out, _ = run(*files, *world, "--way-home", form)
    found = [
        pair for line in ([out] if form == "--json" else out.splitlines()) for pair in said_and_data(json.loads(line))
    ]
    known = {data["code"]: said for said, data in found if data["code"] is not None}
    assert {"no_ceiling", "jumps_without_end", "items_unreached", "inside_zone", "too_low", "return_fails"} <= set(
        known
    )
    for said, data in found:
        if data["code"] is not None:
            fields = fields_of(TEXTS[data["code"]])
            assert fields <= set(data["data"]), said
    # Sentences name what was typed; data do not.
    assert known["no_ceiling"].startswith("--max-agl is not set")
    assert next(data for _, data in found if data["code"] == "no_ceiling")["data"] == {}
    low = next(data for _, data in found if data["code"] == "too_low")
    assert low["data"]["by_m"] == low["by"]


@pytest.mark.nightly
def test_without_a_mission_file_the_options_are_named_and_with_one_its_keys(
    run: Any, folder: Path, world: list[str]
) -> None:
    file = file_of(folder, "round")
    _, out, err = run(file, *world, "--max-amsl", "500", "--way-home")
    assert "write the vehicle's own as --rtl-altitude" in out + err
    assert "above --max-amsl" in out
    assert not re.search(r"rtl_rel_home_m|max_amsl_m|min_agl_m", out + err)
    run(file, *world, "--max-amsl", "500", "--way-home", "--report", folder / "page.html")
    page = (folder / "page.html").read_text()
    assert "above --max-amsl" in page
    assert "as --rtl-altitude" in page
    assert not re.search(r"rtl_rel_home_m|max_amsl_m|min_agl_m", page)
    round_trip = corpus.cases()[0].items
    (folder / "back.waypoints").write_text(
        corpus.qgroundcontrol((*round_trip[:-1], replace(round_trip[-1], command=20)))
    )
    _, out, _ = run(folder / "back.waypoints", *world, "-q")
    assert "the return home is not judged: its altitude is the vehicle's own (give --rtl-altitude)" in out


@pytest.mark.slow
def test_a_plans_own_fence_is_held_against_it(run: Any, folder: Path, world: list[str]) -> None:
    plan = json.loads(Path(file_of(folder, "round")).read_text())
    lat, lon = corpus.degrees(1000, -1600)
    plan["geoFence"]["circles"] = [{"circle": {"center": [lat, lon], "radius": 50}, "inclusion": False, "version": 1}]
    file = folder / "fenced.plan"
    file.write_text(json.dumps(plan))
    code, out, _ = run(file, *world, "-q")
    assert code == 4
    assert ": fence: " in out
    plan["geoFence"]["circles"][0]["circle"]["center"] = list(corpus.degrees(0, 1000))
    file.write_text(json.dumps(plan))
    assert run(file, *world, "-q")[0] == 0
    # Corners where the plane has no place, a quarter of the globe away, and an outline that crosses itself.
    plan["geoFence"]["circles"] = []
    lat, lon = corpus.degrees(0, 0)
    far, southwest, southeast, northwest, northeast = (
        [0.0, lon + 90.0], *(list(corpus.degrees(e, n)) for n in (-9000, 9000) for e in (-9000, 9000)),
    )  # fmt: skip
    for corners, inclusion, said in (
        ([southwest, southeast, far], False, ""), ([southwest, southeast, far], True, ": fence: "),
        ([southwest, northwest, far], False, ": fence: "), ([southwest, northwest, [lat + 30.0, lon], far], True, ""),
        ([southwest, northeast, southeast, northwest], True, "crosses"),
    ):  # fmt: skip
        plan["geoFence"]["polygons"] = [{"polygon": corners, "inclusion": inclusion, "version": 1}]
        file.write_text(json.dumps(plan))
        code, out, err = run(file, *world, "-q")
        assert code == (4 if said else 0), err
        assert said in out
        assert "Warning" not in err
