"""Mission files: what is written reads back the same, strangers' manners are read, damage is named with its place."""

from __future__ import annotations

import gc
import json
import math
import os
import struct
from dataclasses import replace
from decimal import ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mavlink.files.file_items import MAX_FILE_BYTES, PLAIN_XY, degrees_e7_of, degrees_text, float32_text
from gcsplan.mavlink.files.formats import read_mission_file, read_plan, read_waypoints, write_plan, write_waypoints
from gcsplan.mavlink.files.plan_file import parse_plan
from gcsplan.mavlink.files.waypoints_file import parse_waypoints
from gcsplan.mavlink.mission.commands import DO_CHANGE_SPEED, DO_JUMP, LAND, RTL, TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import GLOBAL, NO_POSITION, RELATIVE, TERRAIN, Home, Mission, MissionItem, float32
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import draws

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
HOME = Home(366_000_000, -843_800_000, 312.345678901)
HEAD = "QGC WPL 110\n"
HOME_LINE = "0\t1\t0\t16\t0\t0\t0\t0\t36.60000000\t-84.38000000\t312.5\t1\n"
POINT = "1\t0\t3\t16\t0\t0\t0\t0\t36.61000000\t-84.37000000\t60.125\t1\n"


def short_mission(autopilot: Autopilot = COPTER) -> Mission:
    return Mission(
        autopilot,
        HOME,
        (
            MissionItem(TAKEOFF, RELATIVE, (0, 0, 0, 0), 366_000_000, -843_800_000, 65.005),
            MissionItem(DO_CHANGE_SPEED, NO_POSITION, (1, 12.4, -1, 0)),
            MissionItem(WAYPOINT, RELATIVE, (1.5, 0, 0, 0), 366_123_457, -843_700_001, 120.125),
            MissionItem(WAYPOINT, GLOBAL, (0, 0, 0, 0), 366_123_499, -843_699_999, 700.1),
            MissionItem(RTL, NO_POSITION),
        ),
    )


def wire(mission: Mission) -> tuple[object, ...]:
    """Everything of a mission that a file is to keep, comparable although NaN is in it."""
    home = mission.home
    return mission.autopilot, home.lat_e7, home.lon_e7, home.amsl_m, tuple(i.wire for i in mission.items)


# -- random missions ----------------------------------------------------------------------------------------------


def bits32(bits: int) -> float:
    return float(struct.unpack("<f", struct.pack("<I", bits))[0])


finite32 = st.one_of(
    st.floats(width=32, allow_nan=False, allow_infinity=False),
    st.integers(0, 2**32 - 1).map(bits32).filter(math.isfinite),
    st.sampled_from([0.0, -0.0, 0.1, 17.125, 65.005, 1e9, 123456792.0, 1.4e-45, 3.4028235e38]),
)
lat_e7 = st.integers(-90 * 10**7, 90 * 10**7)
lon_e7 = st.integers(-180 * 10**7, 180 * 10**7)
int32 = st.integers(-(2**31), 2**31 - 1)


@st.composite
def missions(draw: st.DrawFn, *, nan: bool = False) -> Mission:
    param = st.one_of(finite32, st.just(math.nan)) if nan else finite32
    count = draw(st.integers(0, 8))
    autopilot = draw(st.sampled_from(list(Autopilot)))
    first = 1 if autopilot.is_ardupilot else 0
    items = []
    for _ in range(count):
        frame = draw(st.sampled_from([GLOBAL, NO_POSITION, RELATIVE, TERRAIN]))
        command = draw(st.one_of(st.sampled_from([16, 17, 20, 21, 22, 93, 177, 178, 203]), st.integers(0, 65535)))
        params = [draw(param) for _ in range(4)]
        if command == DO_JUMP:
            params[0] = float(draw(st.integers(first, first + count - 1)))
        plain = frame == NO_POSITION or command in PLAIN_XY
        x, y = (draw(int32), draw(int32)) if plain else (draw(lat_e7), draw(lon_e7))
        z = draw(param if plain else finite32)
        items.append(MissionItem(command, frame, tuple(params), x, y, z, draw(st.booleans())))
    amsl = draw(st.floats(-500, 9000))
    return Mission(autopilot, Home(draw(lat_e7), draw(lon_e7), amsl), tuple(items))


@pytest.mark.nightly
@settings(max_examples=draws(80))
@given(missions())
def test_a_waypoints_file_reads_back_as_the_same_mission(mission: Mission) -> None:
    text = write_waypoints(mission)
    assert wire(read_waypoints(text, autopilot=mission.autopilot, where="f")) == wire(mission)
    assert write_waypoints(mission) == text
    held = read_mission_file("no/such.waypoints", autopilot=mission.autopilot, data=text.encode())
    assert wire(held.mission) == wire(mission)  # a file that lies on no disk


@pytest.mark.nightly
@settings(max_examples=draws(80))
@given(missions(nan=True))
def test_a_plan_file_reads_back_as_the_same_mission(mission: Mission) -> None:
    text = write_plan(mission)
    assert wire(read_plan(text, autopilot=mission.autopilot, where="f")) == wire(mission)
    assert wire(read_plan(text, autopilot=None, where="f")) == wire(mission)
    assert write_plan(mission) == text


@settings(max_examples=draws(300))
@given(finite32)
def test_float32_text_is_the_shortest_that_gives_the_same_bits(value: float) -> None:
    text = float32_text(value)
    assert struct.pack("<f", float(text)) == struct.pack("<f", value)
    digits = len(Decimal(text).normalize().as_tuple().digits)
    if digits > 1:
        assert float32(float(f"{value:.{digits - 2}e}")) != value


@settings(max_examples=draws(300))
@given(int32)
def test_degrees_text_is_exact(e7: int) -> None:
    assert Decimal(degrees_text(e7)) == Decimal(e7) / 10**7
    assert degrees_e7_of(float(degrees_text(e7))) == e7 == degrees_e7_of(e7 / 1e7)
    assert len(degrees_text(e7).split(".")[1]) == 8


def test_degrees_are_rounded_and_never_truncated() -> None:
    assert degrees_e7_of(36.12345679) == 361_234_568
    assert degrees_e7_of(-84.38765439) == -843_876_544
    assert degrees_e7_of(0.00000006) == 1


@settings(max_examples=draws(300))
@given(int32, st.sampled_from(["0", "4", "48", "49", "4999", "5", "50001", "51", "99"]))
def test_degrees_are_rounded_as_the_decimals_that_they_are_written_in(e7: int, beyond: str) -> None:
    degrees = float(degrees_text(e7)[:-1] + beyond)
    exact = Decimal(repr(degrees)).scaleb(7).to_integral_value(ROUND_HALF_EVEN)
    assert degrees_e7_of(degrees) == int(exact)


@pytest.mark.parametrize("field", ["1e400", "0." + "0" * 70, "+.5", "5.", "-1E2", "1_0", "١", "inf", "NaN", "0x1"])
@pytest.mark.parametrize("column", [0, 2, 4, 8, 10])
def test_a_row_is_read_at_once_as_it_is_number_by_number(
    field: str, column: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = ["1", "0", "3", "16", "0", "0", "0", "0", "36.6", "-84.3", "100", "1"]
    row[column] = field
    text = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t36.6\t-84.3\t400\t1\n" + "\t".join(row) + "\n"

    def read() -> str:
        try:
            return repr(parse_waypoints(text, autopilot=COPTER, where="x"))
        except InputError as why:
            return str(why)

    at_once = read()
    monkeypatch.setattr("gcsplan.mavlink.files.waypoints_file.numbers_at_once", lambda line, fields: [])
    assert read() == at_once


# -- the text of .waypoints ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_the_waypoints_text_is_what_the_strictest_reader_takes(autopilot: Autopilot) -> None:
    text = write_waypoints(short_mission(autopilot))
    lines = text.split("\n")
    assert lines[0] == "QGC WPL 110"
    assert lines[-1] == ""
    assert "\r" not in text
    rows = [line.split("\t") for line in lines[1:-1]]
    assert {len(row) for row in rows} == {12}
    assert rows[0] == ["0", "1", "0", "16", "0", "0", "0", "0", "36.60000000", "-84.38000000", "312.345678901", "1"]
    assert rows[3] == ["3", "0", "3", "16", "1.5", "0", "0", "0", "36.61234570", "-84.37000010", "120.125", "1"]
    assert rows[2] == ["2", "0", "2", "178", "1", "12.4", "-1", "0", "0", "0", "0", "1"]
    assert [row[0] for row in rows] == [str(i) for i in range(6)]


def test_nan_is_refused_in_waypoints_and_null_in_a_plan() -> None:
    item = MissionItem(WAYPOINT, RELATIVE, (0, 0, 0, math.nan), 1, 2, 3)
    mission = Mission(PX4, HOME, (item,))
    with pytest.raises(InputError, match="param4 of item 0 is nan"):
        write_waypoints(mission)
    assert json.loads(write_plan(mission))["mission"]["items"][0]["params"][3] is None
    with pytest.raises(InputError, match="param7 of item 0 is nan"):
        write_plan(Mission(PX4, HOME, (replace(item, z=math.nan),)))


@pytest.mark.parametrize(
    ("item", "home", "said"),
    [
        (MissionItem(WAYPOINT, 1, x=1), HOME, "frame 1"),
        (MissionItem(WAYPOINT, RELATIVE, x=90 * 10**7 + 1), HOME, "not a place"),
        (MissionItem(WAYPOINT, RELATIVE, (math.inf, 0, 0, 0)), HOME, "param1"),
        (MissionItem(WAYPOINT, RELATIVE), Home(0, 181 * 10**7, 0.0), "home lies at"),
        (MissionItem(WAYPOINT, RELATIVE), Home(0, 0, math.nan), "altitude of home"),
        (MissionItem(DO_JUMP, NO_POSITION, (7, 1, 0, 0)), HOME, "jumps to item 7"),
        (MissionItem(DO_JUMP, NO_POSITION, (1.5, 1, 0, 0)), HOME, "jumps to item 1.5"),
    ],
)
@pytest.mark.parametrize("write", [write_waypoints, write_plan])
def test_what_no_file_can_carry_is_refused_by_name(item: MissionItem, home: Home, said: str, write: Any) -> None:
    with pytest.raises(InputError, match=said):
        write(Mission(COPTER, home, (item,)))


def test_int_twins_of_the_frames_are_written_plain_and_read_as_the_same() -> None:
    items = tuple(MissionItem(WAYPOINT, frame, x=5, y=6, z=7) for frame in (5, 6, 11))
    mission = Mission(COPTER, HOME, items)
    plain = tuple(MissionItem(WAYPOINT, frame, x=5, y=6, z=7) for frame in (0, 3, 10))
    assert read_waypoints(write_waypoints(mission), autopilot=COPTER, where="").items == plain
    assert read_plan(write_plan(mission), autopilot=COPTER, where="").items == plain
    twin = HEAD + HOME_LINE + POINT.replace("1\t0\t3", "1\t0\t6")
    assert read_waypoints(twin, autopilot=COPTER, where="").items[0].frame == RELATIVE


# -- jumps --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("autopilot", "target"), [(COPTER, 3.0), (PX4, 2.0)])
def test_a_jump_is_written_as_the_files_own_number_and_read_as_the_wires(autopilot: Autopilot, target: float) -> None:
    jump = MissionItem(DO_JUMP, NO_POSITION, (target, 2, 0, 0))
    mission = replace(short_mission(autopilot), items=(*short_mission().items[:4], jump))
    row = write_waypoints(mission).splitlines()[6].split("\t")
    assert row[:5] == ["5", "0", "2", "177", "3"]
    plan = json.loads(write_plan(mission))["mission"]["items"]
    assert plan[4]["params"][0] == 3 == plan[2]["doJumpId"]
    assert read_waypoints(write_waypoints(mission), autopilot=autopilot, where="").items[4] == jump
    assert read_plan(write_plan(mission), autopilot=autopilot, where="").items[4] == jump


def test_a_plans_jump_ids_need_not_be_in_order() -> None:
    plan = json.loads(write_plan(short_mission(PX4)))
    items = plan["mission"]["items"]
    for item, number in zip(items, (10, 20, 30, 40, 50), strict=True):
        item["doJumpId"] = number
    items[4].update(command=DO_JUMP, params=[30, 1, 0, 0, 0, 0, 0])
    assert read_plan(json.dumps(plan), autopilot=PX4, where="f").items[4].params[0] == 2.0
    items[0]["doJumpId"] = 30
    with pytest.raises(InputError, match="doJumpId 30 stands twice"):
        read_plan(json.dumps(plan), autopilot=PX4, where="f")
    items[4]["params"][0] = 31
    items[0]["doJumpId"] = 10
    with pytest.raises(InputError, match="jumps to item 31"):
        read_plan(json.dumps(plan), autopilot=PX4, where="f")


def test_header_120_has_no_home_row_and_counts_jumps_from_its_first_item() -> None:
    jump = "2\t0\t2\t177\t1\t3\t0\t0\t0\t0\t0\t1\n"
    text = "QGC WPL 120\n" + POINT.replace("1\t", "0\t", 1) + POINT + jump
    with pytest.raises(InputError, match=r"no row is home; write .QGC WPL 110. there"):
        read_waypoints(text, autopilot=COPTER, where="f")
    for autopilot, target in ((COPTER, 2.0), (PX4, 1.0)):
        read = parse_waypoints(text, autopilot=autopilot, where="f", home_hint=HOME)
        assert read.mission.home == HOME
        assert len(read.mission.items) == 3
        assert read.mission.items[2].params[0] == target
        assert read.notes[0] == Note("home_row_missing")


# -- other writers' manners ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        (HEAD + HOME_LINE + POINT).replace("\n", "\r\n"),
        (HEAD + HOME_LINE + POINT).replace("\t", " "),
        "\ufeff" + HEAD + HOME_LINE + POINT.replace("\t", ", "),
        HEAD + "\n# a comment\n" + HOME_LINE + "  \n" + POINT.rstrip("\n"),
        HEAD + HOME_LINE.replace("312.5", "+3.125e2") + POINT.replace("60.125", "60.12500000 "),
        (HEAD + HOME_LINE + POINT).replace("\n", "\r"),
    ],
)
def test_every_writers_manner_gives_the_same_mission(text: str) -> None:
    mission = read_waypoints(text, autopilot=COPTER, where="f")
    assert mission.home == Home(366_000_000, -843_800_000, 312.5)
    assert mission.items == (MissionItem(WAYPOINT, RELATIVE, (0, 0, 0, 0), 366_100_000, -843_700_000, 60.125),)


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_pymavlink_reads_what_we_write_and_we_read_what_it_saves(tmp_path: Path) -> None:
    os.environ["MAVLINK20"] = "1"
    from pymavlink import mavwp

    mission = short_mission()
    file = tmp_path / "uav1.waypoints"
    file.write_text(write_waypoints(mission), encoding="utf-8")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(file)) == 6
    for seq, item in enumerate(mission.wire_items()):
        w = loader.wp(seq)
        placed = item.frame != NO_POSITION
        assert (w.command, w.frame) == (item.command, item.frame)
        assert [round(w.x * 1e7), round(w.y * 1e7)] == ([item.x, item.y] if placed else [0, 0])
        assert [float32(v) for v in (w.param1, w.param2, w.param3, w.param4, w.z)] == [*item.params, item.z]
    loader.save(str(file))
    gc.collect()  # it leaves its files open
    read = read_mission_file(file, autopilot=COPTER)
    assert Note("six_decimals") in read.notes
    assert read.mission.items[1] == mission.items[1]
    assert read.mission.items[2].x == 366_123_460  # 36.6123457 with six decimals


def test_six_decimals_are_only_remarked_where_all_have_them() -> None:
    assert parse_waypoints(HEAD + HOME_LINE + POINT, autopilot=COPTER, where="").notes == ()


def test_nan_params_of_a_px4_mission_that_mavproxy_saved_are_read() -> None:
    text = HEAD + HOME_LINE + POINT.replace("0\t0\t0\t0\t36", "0\t0\t0\tnan\t36")
    assert math.isnan(read_waypoints(text, autopilot=PX4, where="").items[0].params[3])


def test_mission_planners_unknown_home_takes_the_missions_own() -> None:
    text = HEAD + "0\t1\t0\t0\t0\t0\t0\t0\t0\t0\t0\t1\r\n" + POINT
    read = parse_waypoints(text, autopilot=COPTER, where="f", home_hint=HOME)
    assert read.mission.home == HOME
    assert len(read.mission.items) == 1
    assert Note("home_row_without_place") in read.notes
    assert Note("home_row_at_zero") in parse_waypoints(text, autopilot=COPTER, where="f").notes


def test_a_missing_home_row_needs_the_missions_home() -> None:
    with pytest.raises(InputError, match="silently loses its first real item"):
        read_waypoints(HEAD + POINT, autopilot=COPTER, where="f")
    mission = read_waypoints(HEAD + POINT, autopilot=COPTER, where="f", home_hint=HOME)
    assert (mission.home, len(mission.items)) == (HOME, 1)


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_real_item_in_the_place_of_home_is_refused(autopilot: Autopilot) -> None:
    for row in ("0\t1\t3\t22\t0\t0\t0\t0\t36.6\t-84.3\t30\t1\n", POINT.replace("1\t0\t3", "0\t0\t3", 1)):
        with pytest.raises(InputError, match=r"^f:2: row 0 must be home") as caught:
            read_waypoints(HEAD + row, autopilot=autopilot, where="f", home_hint=HOME)
        assert "would be lost" in caught.value.message


def test_camera_commands_keep_plain_numbers_whatever_their_frame() -> None:
    shoot = "1\t0\t3\t203\t0\t0\t0\t0\t1.00000000\t0.00000000\t0\t1\n"
    assert read_waypoints(HEAD + HOME_LINE + shoot, autopilot=COPTER, where="").items[0].x == 1


# -- damage -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "first line"),
        ("QGC WPL 100\n" + HOME_LINE, "first line"),
        ("QGC WPL 110 extra\n" + HOME_LINE, "first line"),
        (HEAD + HOME_LINE + POINT.replace("\t1\n", "\n"), r"f:3: a row has 12 columns, this one has 11"),
        (HEAD + HOME_LINE + POINT.replace("36.61", "36,61"), r"f:3: a row has 12 columns, this one has 13"),
        (HEAD + HOME_LINE + POINT.replace("60.125", "sixty"), r"f:3: z must be a number, given 'sixty'"),
        (HEAD + HOME_LINE + POINT.replace("60.125", "nan"), "f:3: z must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "inf"), "f:3: x must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "nan"), "f:3: x must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "1e999"), "f:3: x must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "3_6.61"), "f:3: x must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "٣٦"), "f:3: x must"),
        (HEAD + HOME_LINE + POINT.replace("36.61000000", "91"), "f:3: the latitude must lie within ±90"),
        (HEAD + HOME_LINE + POINT.replace("-84.37000000", "180.1"), "f:3: the longitude must lie within"),
        (HEAD + HOME_LINE.replace("36.6", "96.6") + POINT, "f:2: home must lie within"),
        (HEAD + HOME_LINE + POINT + POINT, "f:4: seq must be 2 here, given 1: the same row twice"),
        (HEAD + HOME_LINE + POINT.replace("1\t", "3\t", 1), "f:3: seq must be 1 here, given 3: rows are missing"),
        (HEAD + POINT.replace("1\t", "4\t", 1), "f:2: the first row must be 0"),
        (HEAD + HOME_LINE + POINT.replace("\t16\t", "\t16.5\t"), "f:3: the command must be a whole number"),
        (HEAD + HOME_LINE + POINT.replace("\t16\t", "\t70000\t"), "f:3: the command must be a whole number"),
        (HEAD + HOME_LINE + POINT.replace("1\t0\t3", "1\t0\t1", 1), "f:3: the frame must be 0"),
        (HEAD + HOME_LINE + POINT.replace("\t1\n", "\t2\n"), "autocontinue"),
        (HEAD + HOME_LINE + POINT.replace("60.125", "1e39"), "float32"),
        (HEAD + HOME_LINE + POINT.replace("1\t0\t3", "1\t0\t2", 1), "param5 of command 16 in frame 2 must be a whole"),
        (HEAD + HOME_LINE + "1" * 2000 + "\n", "f:3: a line of more than"),
    ],
)
def test_damage_in_waypoints_is_named_with_its_line(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_waypoints(text, autopilot=COPTER, where="f")


def test_all_mistakes_are_told_at_once() -> None:
    text = HEAD + HOME_LINE + POINT.replace("36.61", "99.61") + POINT.replace("1\t", "2\t", 1).replace("-84", "-284")
    with pytest.raises(InputError) as caught:
        read_waypoints(text, autopilot=COPTER, where="f")
    assert [p.where for p in caught.value.problems] == ["f:3", "f:4"]


@pytest.mark.parametrize("command", [188, 189])
def test_where_a_landing_sequence_begins_may_stand_in_degrees_in_frame_2(command: int) -> None:
    # PX4's own test missions have it so; ground stations send the whole part.
    plan = plan_of()
    row = {"type": "SimpleItem", "autoContinue": True, "command": command, "doJumpId": 99, "frame": 2}
    plan["mission"]["items"].append(row | {"params": [0, 0, 0, 0, 47.397, 8.54505, 0]})
    read = read_plan(json.dumps(plan), autopilot=COPTER, where="f").items[-1]
    assert (read.command, read.x, read.y) == (command, 47, 8)


@pytest.mark.slow
def test_a_mission_of_more_than_ten_thousand_items_is_not_read() -> None:
    rows = "".join(f"{i}\t0\t3\t16\t0\t0\t0\t0\t1\t1\t1\t1\n" for i in range(1, 10_005))
    with pytest.raises(InputError, match="more than 10000 items"):
        read_waypoints(HEAD + HOME_LINE + rows, autopilot=COPTER, where="f")
    simple = {"type": "SimpleItem", "command": 20, "frame": 2, "autoContinue": True, "params": [0] * 7}
    plan = json.loads(write_plan(short_mission()))
    plan["mission"]["items"] = [simple] * 10_001
    with pytest.raises(InputError, match="more than 10000 items"):
        read_plan(json.dumps(plan), autopilot=COPTER, where="f")


@settings(max_examples=draws(200))
@given(st.data())
def test_no_text_makes_the_waypoints_reader_stumble(data: st.DataObject) -> None:
    good = HEAD + HOME_LINE + POINT
    pieces = st.one_of(
        st.text(max_size=20), st.sampled_from(["\t", "\n", "-1", "1e400", "nan", "inf", "99999999999", "\x00", "#"])
    )
    at = data.draw(st.integers(0, len(good)))
    text = good[:at] + data.draw(pieces) + good[at + data.draw(st.integers(0, 8)) :]
    for candidate in (text, data.draw(st.text(max_size=60)), HEAD + data.draw(st.text(max_size=60))):
        try:
            mission = read_waypoints(candidate, autopilot=COPTER, where="f", home_hint=HOME)
        except InputError:
            continue
        assert all(abs(i.x) <= 2**31 and math.isfinite(i.z) for i in mission.items)


# -- .plan --------------------------------------------------------------------------------------------------------


def plan_of(mission: Mission | None = None, **mission_keys: Any) -> dict[str, Any]:
    plan: dict[str, Any] = json.loads(write_plan(mission or short_mission()))
    plan["mission"].update(mission_keys)
    return plan


def test_the_plan_is_what_qgroundcontrol_and_mavsdk_ask_for() -> None:
    text = write_plan(short_mission(PX4))
    plan = json.loads(text)
    assert text.endswith("}\n")
    assert (plan["fileType"], plan["version"], plan["groundStation"]) == ("Plan", 1, "gcsplan")
    assert plan["geoFence"] == {"circles": [], "polygons": [], "version": 2}
    assert plan["rallyPoints"] == {"points": [], "version": 2}
    mission = plan["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 12, 2)
    assert mission["plannedHomePosition"] == [36.6, -84.38, 312.345678901]
    assert mission["globalPlanAltitudeMode"] == 0  # mixed: relative and absolute
    assert mission["hoverSpeed"] == 12.4
    assert [i["doJumpId"] for i in mission["items"]] == [1, 2, 3, 4, 5]
    point = mission["items"][2]
    assert point["params"] == [1.5, 0, 0, 0, 36.6123457, -84.3700001, 120.125]
    assert (point["Altitude"], point["AltitudeMode"], point["AMSLAltAboveTerrain"]) == (120.125, 1, None)
    assert mission["items"][3]["AltitudeMode"] == 2
    assert "Altitude" not in mission["items"][1]
    assert {i["type"] for i in mission["items"]} == {"SimpleItem"}


@pytest.mark.parametrize(
    ("key", "room", "said"),
    [
        ("geoFence", {"circles": [{"inclusion": 1, "circle": {}}]}, "circles\\[0\\].*inclusion"),
        ("geoFence", {"circles": [{"inclusion": True, "circle": {"center": [1, 2], "radius": -1}}]}, "radius"),
        ("geoFence", {"circles": [{"inclusion": True, "circle": {"center": [1, None], "radius": 1}}]}, "center"),
        ("geoFence", {"polygons": [{"inclusion": False, "polygon": [[1, 2], [3, 4]]}]}, "3 corners"),
        ("geoFence", {"polygons": {}}, "must be a list"),
        ("rallyPoints", {"points": [[1, 2]]}, "points\\[0\\]"),
        ("rallyPoints", {"points": [[1, 2, None]]}, "altitude above home"),
        ("rallyPoints", {"points": [[91, 2, 3]]}, "within"),
    ],
)
def test_a_broken_fence_or_rally_point_is_named_with_its_key(key: str, room: Any, said: str) -> None:
    plan = json.loads(write_plan(short_mission()))
    plan[key] = room
    with pytest.raises(InputError, match=said):
        parse_plan(json.dumps(plan), autopilot=COPTER, where="x.plan")


def test_kind_and_speeds_of_the_vehicle_stand_in_the_plan() -> None:
    limits = Limits(min_agl_m=30)
    vehicle = Vehicle("a", 1, PX4, limits, speed_max_m_s=22.5, turn_radius_m=80)
    item = MissionItem(WAYPOINT, TERRAIN, x=1, y=1, z=50)
    mission = json.loads(write_plan(Mission(PX4, HOME, (item,)), vehicle=vehicle))["mission"]
    assert (mission["vehicleType"], mission["cruiseSpeed"], mission["globalPlanAltitudeMode"]) == (1, 22.5, 4)
    assert json.loads(write_plan(short_mission(PLANE)))["mission"]["vehicleType"] == 1
    assert json.loads(write_plan(Mission(PX4, HOME, (item,))))["mission"]["hoverSpeed"] == 5


def test_fence_and_rally_points_are_written_from_their_wire_items() -> None:
    def vertex(command: int, p1: float, x: int, y: int, z: float = 0.0) -> MissionItem:
        return MissionItem(command, GLOBAL, (p1, 0, 0, 0), x * 10**7, y * 10**7, z)

    fence = [vertex(5002, 3, 1, 2), vertex(5002, 3, 1, 3), vertex(5002, 3, 2, 3), vertex(5004, 40.5, 5, 6),
             vertex(5001, 3, 0, 0), vertex(5001, 3, 0, 9), vertex(5001, 3, 9, 9)]  # fmt: skip
    plan = json.loads(write_plan(short_mission(), fence=fence, rally=[vertex(5100, 0, 7, 8, 90.5)]))
    assert plan["geoFence"]["polygons"] == [
        {"inclusion": False, "polygon": [[1, 2], [1, 3], [2, 3]], "version": 1},
        {"inclusion": True, "polygon": [[0, 0], [0, 9], [9, 9]], "version": 1},
    ]
    assert plan["geoFence"]["circles"] == [
        {"circle": {"center": [5, 6], "radius": 40.5}, "inclusion": False, "version": 1}
    ]
    assert plan["rallyPoints"]["points"] == [[7, 8, 90.5]]
    read = parse_plan(json.dumps(plan), autopilot=COPTER, where="")
    assert read.notes == ()
    assert read.fence == (fence[3], *fence[:3], *fence[4:])  # circles come first in a plan
    assert [(r.x, r.y, r.z) for r in read.rally] == [(7 * 10**7, 8 * 10**7, 90.5)]
    for broken in (fence[:2], [vertex(5100, 0, 1, 1)], [vertex(5001, math.nan, 1, 1)]):
        with pytest.raises(InputError, match="whole polygons and circles"):
            write_plan(short_mission(), fence=broken)


@pytest.mark.parametrize(
    ("firmware", "kind", "autopilot"),
    [
        (3, 2, COPTER), (3, 13, COPTER), (3, 43, COPTER), (3, 1, PLANE), (3, 20, PLANE), (3, 28, PLANE), (12, 2, PX4),
        (12, 1, PX4), (3, None, COPTER),
    ],
)  # fmt: skip
def test_the_plan_says_for_which_autopilot_it_is(firmware: int, kind: int | None, autopilot: Autopilot) -> None:
    text = json.dumps(plan_of(firmwareType=firmware, vehicleType=kind))
    assert read_plan(text, autopilot=None, where="f").autopilot is autopilot
    for other in set(Autopilot) - {autopilot}:
        if kind is None and other is PLANE:
            assert read_plan(text, autopilot=other, where="f").autopilot is PLANE
            continue
        with pytest.raises(InputError, match=f"the file is for {autopilot}, not for {other}"):
            read_plan(text, autopilot=other, where="f")


def test_a_plan_that_names_no_autopilot_is_read_for_the_one_given() -> None:
    text = json.dumps(plan_of(firmwareType=0))
    with pytest.raises(InputError, match="for which autopilot"):
        read_plan(text, autopilot=None, where="f")
    read = parse_plan(text, autopilot=PX4, where="f")
    assert read.mission.autopilot is PX4
    assert read.notes[0] == Note("plan_without_autopilot", autopilot="px4")
    with pytest.raises(InputError, match="firmwareType 3 with vehicleType 11"):
        read_plan(json.dumps(plan_of(vehicleType=11)), autopilot=COPTER, where="f")


def test_a_survey_is_read_as_the_items_that_it_holds() -> None:
    plan = plan_of(short_mission(PX4))
    items = plan["mission"]["items"]
    survey = {"type": "ComplexItem", "complexItemType": "survey", "version": 5,
              "TransectStyleComplexItem": {"version": 1, "Items": items[2:4]}}  # fmt: skip
    plan["mission"]["items"] = [*items[:2], survey, items[4]]
    read = parse_plan(json.dumps(plan), autopilot=PX4, where="f")
    assert wire(read.mission) == wire(short_mission(PX4))
    assert "survey" in str(read.notes[0])
    plan["mission"]["items"][2] = {"type": "ComplexItem", "complexItemType": "fwLandingPattern", "landCoordinate": []}
    with pytest.raises(InputError, match=r"f: mission.items\[2\]: a complex item \(fwLandingPattern\)"):
        read_plan(json.dumps(plan), autopilot=PX4, where="f")


@pytest.mark.parametrize(("kind", "land"), [("fwLandingPattern", 21), ("vtolLandingPattern", 85)])
@pytest.mark.parametrize("circle", [True, False])
def test_a_landing_pattern_is_read_as_the_items_that_are_sent_for_it(kind: str, land: int, circle: bool) -> None:
    pattern = {
        "type": "ComplexItem", "complexItemType": kind, "version": 2, "altitudesAreRelative": True,
        "landCoordinate": [36.6, -84.3, 0], "landingApproachCoordinate": [36.61, -84.31, 40], "loiterRadius": 75,
        "loiterClockwise": False, "useLoiterToAlt": circle, "stopTakingPhotos": True, "stopVideoPhotos": False,
    }  # fmt: skip
    plan = json.loads(write_plan(short_mission(PLANE)))
    before = len(plan["mission"]["items"])
    plan["mission"]["items"].append(pattern)
    read = parse_plan(json.dumps(plan), autopilot=PLANE, where="x.plan")
    start, trigger, photos, approach, down = read.mission.items[before:]
    assert (start.command, trigger.command, photos.command, down.command) == (189, 206, 2001, land)
    assert approach.command == (31 if circle else 16)
    assert approach.params[1] == (-75.0 if circle else 0.0)
    assert (approach.lat_deg, approach.z, approach.frame) == (36.61, 40.0, RELATIVE)
    assert (down.lat_deg, down.z, down.frame) == (36.6, 0.0, RELATIVE)
    assert any(kind in str(n) and "stands for" in str(n) for n in read.notes)
    del pattern["landCoordinate"]
    with pytest.raises(InputError, match=r"without its single items.*save it again"):
        parse_plan(json.dumps(plan), autopilot=PLANE, where="x.plan")


def test_a_place_that_is_not_given_is_here_for_ardupilot_and_refused_for_px4() -> None:
    for autopilot in (COPTER, PX4):
        plan = plan_of(short_mission(autopilot))
        plan["mission"]["items"][0]["params"][4:6] = [None, None]
        plan["mission"]["items"][1]["params"][4:6] = [None, None]
        if autopilot is PX4:
            with pytest.raises(InputError, match=r"mission.items\[0\].params: command 22 needs a latitude"):
                read_plan(json.dumps(plan), autopilot=autopilot, where="f")
        else:
            read = parse_plan(json.dumps(plan), autopilot=autopilot, where="f")
            assert (read.mission.items[0].x, read.mission.items[0].y) == (0, 0)
            assert read.notes[0] == Note("item_without_place", entry="mission.items[0]")


def test_mission_planners_json_is_read() -> None:
    plan = plan_of(firmwareType=0, version=0)
    plan.update(fileType=None, groundStation="MissionPlanner", geoFence=None, rallyPoints=None)
    for item in plan["mission"]["items"]:
        item["type"] = None
        item["TransectStyleComplexItem"] = None
        item["doJumpId"] = 0
    assert read_plan(json.dumps(plan), autopilot=COPTER, where="f").items == short_mission().items


def test_a_plan_without_home_takes_the_missions_own() -> None:
    other = Home(10, 20, 30.0)
    for value in (None, [36.6, -84.3, None], [0, 0, 0]):
        text = json.dumps(plan_of(plannedHomePosition=value))
        read = parse_plan(text, autopilot=COPTER, where="f", home_hint=other)
        assert read.mission.home == other
        assert "home" in str(read.notes[0])
    with pytest.raises(InputError, match="plannedHomePosition: home must be given"):
        read_plan(json.dumps(plan_of(plannedHomePosition=None)), autopilot=COPTER, where="f")


def broken_plans() -> list[tuple[str, str]]:
    def item(**keys: Any) -> str:
        plan = plan_of()
        plan["mission"]["items"][2].update(keys)
        return json.dumps(plan)

    key = r"f: mission.items\[2\]"
    return [
        ("{", "f:1: not JSON"),
        ("[]", "JSON object"),
        ("{}", "list of items"),
        ("[" * 100_000, "nested too deep|not JSON"),
        ('{"a": ' + "9" * 5000 + "}", "number is too long"),
        ('{"a": 1, "a": 2}', "stands twice"),
        (json.dumps(plan_of()).replace("120.125", "NaN"), "NaN is no JSON"),
        (json.dumps({**plan_of(), "fileType": "GeoFence"}), "fileType 'Plan'"),
        (json.dumps({**plan_of(), "version": 2}), "f: version: must be 1, given 2"),
        (json.dumps(plan_of(version=1)), "f: mission.version: must be 2"),
        (json.dumps(plan_of(items={})), "list of items"),
        (json.dumps(plan_of(items=[3])), r"mission.items\[0\]: a mission item must be an object"),
        (json.dumps(plan_of(plannedHomePosition=[1, 2])), "plannedHomePosition: home must be"),
        (json.dumps(plan_of(plannedHomePosition=[95, 2, 3])), "plannedHomePosition: home must lie within"),
        (json.dumps(plan_of(plannedHomePosition=["1", 2, 3])), "plannedHomePosition: home must be"),
        (json.dumps(plan_of(firmwareType="x")), "firmwareType x"),
        (item(type="Other"), key + ".type: must be SimpleItem"),
        (item(params=[0] * 6), key + ".params: must be seven numbers"),
        (item(params=[0, 0, 0, "0", 0, 0, 0]), key + ".params: must be seven numbers"),
        (item(params=[True, 0, 0, 0, 0, 0, 0]), key + ".params: must be seven numbers"),
        (item(params=[0, 0, 0, 0, 95, 0, 0]), key + ": the latitude"),
        (item(params=[0, 0, 0, 0, 1, 2, None]), key + ": the altitude"),
        (item(params=[0, 0, 0, 0, 1, None, 3]), key + ".params: command 16 needs"),
        (
            item(params=[0, 0, 0, 0, 1, 2, 3]).replace("[0, 0, 0, 0, 1, 2, 3]", "[0, 0, 0, 0, 1, -1e999, 3]"),
            "longitude",
        ),
        (item(params=[10**400, 0, 0, 0, 1, 2, 3]), key + ": param1"),
        (item(command="16"), key + ": command and frame must be numbers"),
        (item(command=16.5), key + ": the command must be a whole number"),
        (item(frame=8), key + ": the frame must be"),
        (item(frame=2), key + ": param5 of command 16 in frame 2 must be a whole"),
        (item(autoContinue=1), key + ".autoContinue: must be true or false"),
    ]


@pytest.mark.parametrize(("text", "said"), broken_plans())
def test_damage_in_a_plan_is_named_with_its_key(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_plan(text, autopilot=COPTER, where="f")


json_values = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-(10**400), 10**400), st.floats(allow_nan=False), st.text(max_size=5)
    ),
    lambda inner: st.lists(inner, max_size=8) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=draws(100))
@given(st.data())
def test_a_plan_with_any_json_in_it_is_a_whole_mission_or_refused(data: st.DataObject) -> None:
    plan = plan_of()
    spot: Any = plan
    for _ in range(data.draw(st.integers(1, 5))):
        keys = list(spot) if isinstance(spot, dict) else list(range(len(spot)))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(spot[key], dict | list) or not spot[key]:
            break
        holder, spot = spot, spot[key]
    else:
        spot, key = holder, key
    spot[key] = data.draw(json_values)
    text = json.dumps(plan)
    for candidate in (text, text[: data.draw(st.integers(0, len(text)))], data.draw(st.text(max_size=40))):
        try:
            mission = read_plan(
                candidate, autopilot=data.draw(st.sampled_from([COPTER, None])), where="f", home_hint=HOME
            )
        except InputError:
            continue
        again = read_plan(write_plan(mission), autopilot=mission.autopilot, where="again")
        assert repr(again.items) == repr(mission.items)  # NaN is NaN


# -- files on the disk --------------------------------------------------------------------------------------------


def test_the_content_decides_how_a_file_is_read(tmp_path: Path) -> None:
    mission = short_mission()
    for name, text in (
        ("uav1.waypoints", write_waypoints(mission)),
        ("uav1.plan", write_plan(mission)),
        ("uav1.txt", "\ufeff" + write_waypoints(mission)),
        ("uav1.mission", write_plan(mission)),
    ):
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        read = read_mission_file(file, autopilot=COPTER)
        assert read.mission == replace(mission, name="uav1")
        assert read.notes == ()


def test_a_file_that_is_none_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "a.waypoints"
    cases: list[tuple[bytes, str]] = [
        (b"\xff\xfe\x00", "UTF-8"),
        (b"", "first line"),
        (b" " * (MAX_FILE_BYTES + 1), "20 MB"),
    ]
    for content, said in cases:
        file.write_bytes(content)
        with pytest.raises(InputError, match=said):
            read_mission_file(file, autopilot=COPTER)
    other = tmp_path / "a.kml"
    other.write_text("<kml/>", encoding="utf-8")
    with pytest.raises(InputError, match="neither"):
        read_mission_file(other, autopilot=COPTER)
    with pytest.raises(InputError, match="not a regular file"):
        read_mission_file(tmp_path, autopilot=COPTER)
    with pytest.raises(InputError, match="No such file"):
        read_mission_file(tmp_path / "absent.plan", autopilot=COPTER)
    with pytest.raises(InputError, match="not a file name"):
        read_mission_file("a\0b", autopilot=COPTER)
    file.write_text(write_waypoints(short_mission()), encoding="utf-8")
    with pytest.raises(InputError, match="does not name its autopilot"):
        read_mission_file(file, autopilot=None)
    assert LAND not in {i.command for i in read_mission_file(file, autopilot=COPTER).mission.items}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_does_not_hold_the_reader(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.plan")
    with pytest.raises(InputError, match="not a regular file"):
        read_mission_file(tmp_path / "pipe.plan", autopilot=COPTER)


def test_a_vtols_file_that_names_no_vehicle_is_not_judged_as_a_copters(tmp_path: Path) -> None:
    rows = ["QGC WPL 110", "0 1 0 16 0 0 0 0 36.6 -84.3 400 1", "1 0 3 84 0 0 0 0 36.6 -84.3 60 1"]
    file = tmp_path / "a.waypoints"
    file.write_text("\n".join(row.replace(" ", "\t") if k else row for k, row in enumerate(rows)) + "\n")
    taken = read_mission_file(file, autopilot=None, otherwise=Autopilot.ARDUCOPTER)
    assert [n.code for n in taken.not_judged] == ["taken_for_no_vtol"]
    for said in (Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE):
        assert read_mission_file(file, autopilot=said).not_judged == ()
    plan = json.loads(write_plan(read_mission_file(file, autopilot=Autopilot.ARDUPLANE).mission))
    for kind, codes in ((0, ["taken_for_no_vtol"]), (1, []), (2, []), (20, [])):
        plan["mission"]["vehicleType"] = kind
        file.write_text(json.dumps(plan))
        assert [n.code for n in read_mission_file(file, autopilot=None).not_judged] == codes
