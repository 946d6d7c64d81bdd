"""What each autopilot keeps of a mission item, and how altitudes are encoded for it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mavlink.mission.autopilots import altitude_of_cm, autopilot_of, max_items, profile_of, sent_for, stored
from gcsplan.mavlink.mission.mission import FENCE, FRAME_SYNONYMS, GLOBAL, RALLY, Home, Mission, MissionItem, float32
from gcsplan.mavlink.mission.stored_ardupilot import STORAGE_RULES, read_back_altitudes, stored_cm
from gcsplan.mavlink.mission.stored_px4 import LOCATED, yaw
from gcsplan.mavlink.mission.stored_px4 import LOCATED as PX4_LOCATED
from gcsplan.mavlink.mission.stored_px4 import PLACELESS as PX4_PLACELESS
from gcsplan.sim.vehicle.ardupilot import keep_fence_item, keep_mission_item, keep_rally_item
from gcsplan.sim.vehicle.px4 import keep_item
from gcsplan.sim.vehicle.stored_lists import ItemRefused
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
ARDUPILOTS = [COPTER, PLANE]
X, Y = 366_000_000, -843_800_000

WIRE_FLOATS = st.one_of(
    st.floats(width=32, allow_infinity=False),
    st.floats(-400, 400, width=32),
    st.sampled_from([0.0, -0.0, 0.5, 1.9, -1.0, 17.0, 254.7, 255.0, 256.0, 65535.0, 70000.0, math.nan]),
)
CENTIMETRES = st.integers(-50_000, 900_000)


def item(command: int, *params: float, frame: int = 3, z: float = 60.005, x: int = X, y: int = Y) -> MissionItem:
    four = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, four, x, y, z)


# -- altitudes ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=draws(500))
@given(CENTIMETRES, st.sampled_from(list(Autopilot)))
def test_exactly_the_wanted_centimetres_are_stored(cm: int, autopilot: Autopilot) -> None:
    sent = altitude_of_cm(cm, autopilot)
    assert sent == float32(sent)
    if autopilot.is_ardupilot:
        assert stored_cm(sent) == cm
    back = stored(item(16, z=sent), autopilot).z
    assert round(back * 100) == cm
    assert back in (float32(cm / 100), *read_back_altitudes(cm))


def test_every_centimetre_around_zero_and_at_binary_edges_is_stored() -> None:
    edges = {s * ((1 << n) + d) for n in range(20) for d in range(-3, 4) for s in (1, -1)}
    for cm in edges | set(range(-500, 500)):
        if abs(cm) < 8_300_000:
            assert stored_cm(altitude_of_cm(cm, COPTER)) == cm


@pytest.mark.parametrize("cm", [8_300_000, -8_300_000, 9_000_000])
def test_an_altitude_that_cannot_be_kept_is_refused(cm: int) -> None:
    with pytest.raises(InputError, match="altitude"):
        altitude_of_cm(cm, COPTER)
    assert stored_cm(altitude_of_cm(int(math.copysign(8_299_999, cm)), COPTER)) == math.copysign(8_299_999, cm)


@pytest.mark.slow
@settings(max_examples=draws(500))
@given(st.floats(-80_000, 80_000, width=32))
def test_centimetres_are_cut_as_float32_hardware_cuts_them(altitude_m: float) -> None:
    assert stored_cm(altitude_m) == int((np.float32(altitude_m) * np.float32(100)).astype(np.int32))


@pytest.mark.parametrize("autopilot", ARDUPILOTS)
@pytest.mark.parametrize("way", [0, 1])
def test_what_was_read_back_is_judged_at_the_centimetre_that_is_stored(autopilot: Autopilot, way: int) -> None:
    home = Home.at(46.5, 8.5, 400.0)
    heights = [read_back_altitudes(cm)[way] for cm in (0, 3641, 7163, -7270, 28876, 829_999, *range(1, 30_000, 97))]
    board = Mission(autopilot, home, tuple(item(16, z=z) for z in heights))
    again = [stored_cm(kept.z) for kept in sent_for(board).items]
    assert again == [round(z * 100.0) for z in heights]
    assert sent_for(replace(board, items=(item(16, z=36.415),))).items[0].z == float32(36.415)  # never read back


@pytest.mark.parametrize(("sent", "cm"), [(17.13, 1712), (-17.13, -1712), (0.009, 0), (-0.009, 0), (60.005, 6000)])
def test_truncation_as_measured_on_a_real_arducopter(sent: float, cm: int) -> None:
    assert stored_cm(sent) == cm
    assert stored(item(16, z=sent), COPTER).z == read_back_altitudes(cm)[0]


# -- ArduPilot's items, as measured -------------------------------------------------------------------------------

NAN = math.nan


@pytest.mark.parametrize(
    ("command", "sent", "kept"),
    [
        (16, (1.9, 7.0, 8.0, 90.0), (1, 0, 0, 0)),  # hold in whole seconds; radius, pass-by and yaw are lost
        (16, (70000.0, 0, 0, NAN), (4464, 0, 0, 0)),  # 16 bits
        (17, (1, 2, -35.7, 4), (0, 0, -35, 0)),
        (18, (2.5, 0, 300, 1), (2, 0, 300, 1)),
        (18, (0.5, 0, -20.9, 0), (0.5, 0, -20, 0)),
        (18, (300, 0, 17, 1), (255, 0, 17, 1)),
        (18, (-1, 0, 17, 0), (255, 0, 255, 0)),  # negative turns spill into the radius
        (19, (12.7, 1, 40, 0), (12, 0, 1, 0)),
        (20, (1, 2, 3, 4), (0, 0, 0, 0)),
        (21, (0, 0, 0, 0), (0, 0, 0, 1)),
        (21, (3, 0, 0, -1), (3, 0, 0, -1)),
        (22, (15.2, 0, 0, NAN), (15, 0, 0, 0)),
        (31, (0, -60.4, 0, 1), (0, -60, 0, 1)),
        (84, (1, 2, 3, 4), (0, 0, 0, 0)),
        (85, (2, 0, 0, 0), (2, 0, 0, 0)),
        (92, (1, 2, 3, 4), (1, 0, 0, 0)),
        (93, (1.25, -1, 4, 12), (1.25, -1, 4, 12)),
        (112, (2.5, 1, 1, 1), (2.5, 0, 0, 0)),
        (115, (90.5, 10.5, -1, 1), (90.5, 10.5, -1, 1)),
        (177, (5.9, -1, 3, 3), (5, -1, 0, 0)),
        (178, (1.0, 4.37, -1, 1), (1, float32(4.37), -1, 0)),
        (179, (1, 1, 1, 1), (1, 0, 0, 0)),
        (181, (1, 1, 9, 9), (1, 1, 0, 0)),
        (183, (9, 1500.7, 0, 0), (9, 1500, 0, 0)),
        (189, (1, 1, 1, 1), (0, 0, 0, 0)),
        (195, (1, 2, 2, 2), (1, 0, 0, 0)),
        (201, (3, 2, 2, 2), (3, 0, 0, 0)),
        (206, (12.5, 7, 1, 7), (12.5, 0, 1, 0)),
        (211, (1, 0, 7, 7), (1, 0, 0, 0)),
        (5001, (4.0, 1, 1, 1), (4, 0, 0, 0)),
        (5003, (123.4, 1, 1, 1), (float32(123.4), 0, 0, 0)),
        (5004, (50.0005, 1, 1, 1), (50, 0, 0, 0)),
        (5100, (1, 2, 3, 4), (0, 0, 0, 0)),
    ],
)
def test_what_arducopter_keeps_of_the_params(command: int, sent: tuple[float, ...], kept: tuple[float, ...]) -> None:
    assert stored(item(command, *sent), COPTER).params == tuple(map(float, kept))


@pytest.mark.parametrize(("sent", "kept"), [(0, 0), (2, 0), (3, 3), (5, 0), (6, 3), (10, 10), (11, 10)])
def test_frames_come_back_as_their_synonyms(sent: int, kept: int) -> None:
    assert stored(item(16, frame=sent), COPTER).frame == kept


@pytest.mark.parametrize("command", [c for c, rule in STORAGE_RULES.items() if not rule.located])
def test_commands_without_a_place_come_back_in_frame_0_at_nowhere(command: int) -> None:
    back = stored(item(command, 1.0, frame=2), COPTER)
    assert (back.frame, back.x, back.y, back.z) == (GLOBAL, 0, 0, 0.0)


def test_arduplane_packs_acceptance_and_pass_by_radius_in_bytes_and_ignores_the_hold() -> None:
    assert stored(item(16, 5.0, 30.9, 400.0, 9.0), PLANE).params == (0.0, 30.0, 255.0, 0.0)


def test_a_rally_point_keeps_whole_metres() -> None:
    assert [stored(item(5100, z=z), COPTER).z for z in (20.7, -20.7)] == [20.0, -20.0]


def test_an_unknown_command_keeps_its_numbers_but_for_the_altitude() -> None:
    back = stored(item(31999, 1.5, 2.5, 3.5, 4.5, z=17.139), COPTER)
    assert (back.params, back.x, back.y) == ((1.5, 2.5, 3.5, 4.5), X, Y)
    assert back.z == read_back_altitudes(1713)[0]


ITEMS = st.builds(
    MissionItem,
    st.sampled_from([*STORAGE_RULES, *range(5000, 5005), 5100, 31999]),
    st.sampled_from([0, 2, 3, 5, 6, 10, 11]),
    st.tuples(WIRE_FLOATS, WIRE_FLOATS, WIRE_FLOATS, WIRE_FLOATS),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
    st.one_of(st.floats(-500, 9000, width=32), st.floats(width=32, allow_nan=True)),
)


@pytest.mark.slow
@settings(max_examples=draws(400))
@given(ITEMS, st.sampled_from(ARDUPILOTS))
def test_ardupilots_rules_agree_with_an_independent_reading_of_its_source(
    one: MissionItem, autopilot: Autopilot
) -> None:
    try:
        if one.command in range(5000, 5005):
            theirs = keep_fence_item(one, whole_radii=True)
        elif one.command == 5100:
            theirs = keep_rally_item(one)
        else:
            theirs = keep_mission_item(one, plane=autopilot is PLANE)
    except ItemRefused:
        stored(one, autopilot)  # whatever it is, it must not fail
        return
    assert repr(stored(one, autopilot)).replace("-0.0", "0.0") == repr(theirs).replace("-0.0", "0.0")


# -- PX4's items --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "sent", "kept"),
    [
        (16, (1.9, 7.5, 8.0, 0.0), (float32(1.9), 7.5, 0, 0)),
        (17, (1, 2, -35.7, 0), (0, 0, float32(-35.7), 0)),
        (19, (12.7, 5, 40.5, -3), (float32(12.7), 1, 40.5, 0)),
        (21, (1, 2.0, 3, 0), (0, 2, 0, 0)),
        (22, (15, 2, 3, 0), (0, 0, 0, 0)),
        (31, (1, 60.5, 3, 1), (1, 60.5, 0, 1)),
        (201, (3, 1, 1, 1), (0, 0, 0, 0)),
        (5001, (4.0, 1, 1, 1), (4, 0, 0, 0)),
        (5003, (123.4, 1, 1, 1), (float32(123.4), 0, 0, 0)),
    ],
)
def test_what_px4_keeps_of_the_params(command: int, sent: tuple[float, ...], kept: tuple[float, ...]) -> None:
    assert stored(item(command, *sent), PX4).params == tuple(map(float, kept))


@given(st.floats(-1000, 1000, width=32))
def test_px4_wraps_yaw_and_changes_it_by_no_more_than_a_thousandth_of_a_degree(degrees: float) -> None:
    back = yaw(degrees)
    assert -1e-40 <= back <= 360.001  # the tiniest negative angles underflow on the way and stay as they are
    assert abs((back - degrees + 180.0) % 360.0 - 180.0) < 1e-3


def test_px4_keeps_nan_yaw_as_nan() -> None:
    assert math.isnan(stored(item(16, 0, 0, 0, NAN), PX4).params[3])


def test_px4_passes_raw_x_and_y_through_float32_without_a_frame() -> None:
    back = stored(item(179, 1.0, frame=2, x=366_000_001, y=-843_800_003), PX4)
    assert (back.x, back.y) == (int(float32(366_000_001.0)), int(float32(-843_800_003.0)))
    jump = stored(item(177, 5.9, 70000.0, frame=2), PX4)
    assert jump.params[:2] == (5.0, 4464.0)


@pytest.mark.slow
@settings(max_examples=draws(200))
@given(ITEMS, st.sampled_from([*LOCATED, *PX4_PLACELESS]))
def test_px4s_rules_agree_with_an_independent_reading_of_its_source(shape: MissionItem, command: int) -> None:
    one = MissionItem(command, shape.frame, shape.params, shape.x, shape.y, shape.z)
    try:
        theirs = keep_item(one, FENCE if command in range(5000, 5005) else RALLY if command == 5100 else 0)
    except ItemRefused:
        stored(one, PX4)
        return
    ours = stored(one, PX4)
    assert repr(ours.params[:3]).replace("-0.0", "0.0") == repr(theirs.params[:3]).replace("-0.0", "0.0")
    if not abs(one.params[3]) > 10_000:  # of an angle of 3e16 degrees nothing is left to compare
        a, b = ours.params[3], theirs.params[3]
        assert a == b or (math.isnan(a) and math.isnan(b)) or abs((a - b + 180) % 360 - 180) < 1e-3
    assert (ours.command, ours.x, ours.y) == (theirs.command, theirs.x, theirs.y)
    assert repr(ours.z) == repr(theirs.z)
    assert ours.frame == FRAME_SYNONYMS.get(theirs.frame, theirs.frame)


# -- the table ----------------------------------------------------------------------------------------------------


def test_the_table_knows_every_autopilot() -> None:
    for autopilot in Autopilot:
        row = profile_of(autopilot)
        assert row.autopilot is autopilot
        assert row.max_items >= 650
        assert row.atomic is (autopilot is PX4)
        assert all(0 < max_items(autopilot, kind) <= row.max_items for kind in (0, FENCE, RALLY))
    assert profile_of(COPTER).max_items == 650
    assert not profile_of(COPTER).mav_types & profile_of(PLANE).mav_types


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_what_is_refused_is_just_what_the_simulated_vehicle_refuses(autopilot: Autopilot) -> None:
    def refused_there(one: MissionItem) -> bool:
        try:
            if autopilot is PX4:
                keep_item(one, 0)
            else:
                keep_mission_item(one, plane=autopilot is PLANE)
        except ItemRefused:
            return True
        return False

    known = set(PX4_LOCATED) | set(PX4_PLACELESS) if autopilot is PX4 else set(STORAGE_RULES)
    seen = set()
    for command in [*sorted(known - set(range(5000, 5101))), 9, 31000]:
        for frame in (0, 1, 2, 3, 4, 5, 6, 7, 10, 11):
            for params in ((0.0,) * 4, (0.0, 0.0, 0.0, math.nan), (0.0, math.inf, 0.0, 0.0)):
                one = MissionItem(command, frame, params, X, Y, 60.0)
                ours, theirs = profile_of(autopilot).refuses(one), refused_there(one)
                seen.add((bool(ours), theirs))
                assert theirs or not ours, (one, ours)
                if command in known:
                    assert bool(ours) is theirs, (one, ours)
    assert {(True, True), (False, False)} <= seen
    assert "above terrain" in profile_of(PX4).refuses(item(16, frame=10))
    assert profile_of(COPTER).refuses(item(16, frame=11)) == ""


@pytest.mark.parametrize("autopilot", [COPTER, PLANE])
def test_numbers_that_ardupilot_cannot_store_are_refused(autopilot: Autopilot) -> None:
    """A hold of 1e30 s was taken for none: C leaves open what its integer is, and other processors make 18 h of it."""
    refuses = profile_of(autopilot).refuses
    for command, params in ((19, (1e30, 0.0, 0.0, 0.0)), (177, (1.0, -3e9, 0.0, 0.0)), (18, (1.0, 0.0, 1e10, 0.0))):
        number = 1 + max(range(3), key=lambda i: abs(params[i]))
        assert refuses(MissionItem(command, 3, params, X, Y, 60.0)).startswith(f"param{number} of command {command} is")
    for command, params in (
        (19, (70_000.0, 0.0, 0.0, 0.0)),
        (178, (1.0, 1e30, 0.0, 0.0)),
        (18, (0.5, 0.0, -300.0, 0.0)),
    ):
        assert refuses(MissionItem(command, 3, params, X, Y, 60.0)) == ""
    assert refuses(MissionItem(16, 3, (0.0,) * 4, X, Y, 82_999.0)) == ""
    for altitude_m in (83_000.0, -90_000.0, 3e9):
        assert "refuses an altitude of" in refuses(MissionItem(16, 3, (0.0,) * 4, X, Y, altitude_m))
    assert refuses(MissionItem(178, 2, (1.0, 5.0, 0.0, 0.0), 0, 0, 90_000.0)) == ""


@pytest.mark.parametrize(
    ("ids", "found"),
    [
        ((3, 2), Autopilot.ARDUCOPTER),
        ((3, 1), Autopilot.ARDUPLANE),
        ((12, 2), Autopilot.PX4),
        ((3, 10), None),  # a rover
        ((0, 2), None),  # a generic autopilot
    ],
)
def test_an_autopilot_is_known_by_the_ids_of_its_heartbeat(ids: tuple[int, int], found: Autopilot | None) -> None:
    assert autopilot_of(*ids) is found
