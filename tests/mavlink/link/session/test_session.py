"""Sessions with loopback vehicles over UDP: found, asked, uploaded to, read back, and every way in which that fails."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.errors import CheckFailed, GcsplanError, LinkError, ReadBackDiffers, VehicleRefused
from gcsplan.mavlink.link.frames import SigningKey
from gcsplan.mavlink.link.link import Heard, Link
from gcsplan.mavlink.link.options import SessionOptions
from gcsplan.mavlink.link.session import steps
from gcsplan.mavlink.link.session.parameters import judge_fence_parameters, judge_parameters
from gcsplan.mavlink.link.session.preflight import preflight
from gcsplan.mavlink.link.session.results import FailsCheck
from gcsplan.mavlink.link.session.session import (
    UploadOrder,
    discover,
    upload_fleet,
    upload_mission,
)
from gcsplan.mavlink.link.watch import BOOT, CRITICAL, POWEROFF, STANDBY, UNINIT, VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import altitude_of_cm, flies_straight
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import FENCE, RALLY, Home, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.mavlink.protocol.transfer import Timers, TransferProgress
from gcsplan.notes.note import Note
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
HOME = Home.at(36.6, -84.38, 371.0)
QUICK = Timers(response_s=0.15, item_s=0.05, silence_s=0.6, retries=3)
CUT_CORNER = Note("parameters_not_judged", allowed=False, off=())
OPTIONS = SessionOptions(
    unchecked=True, listen_s=0.0, standby_s=0.0, discover_s=5.0, read_parameters=False, timers=QUICK
)


def mission(autopilot: Autopilot = COPTER, count: int = 8, sysid: int = 1, bearing: int = 777) -> Mission:
    z = altitude_of_cm(6500, autopilot)
    items = tuple(
        MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000 + 1000 * n, -843_800_000 + bearing * n, z + n)
        for n in range(count)
    )
    return Mission(autopilot, HOME, items, f"uav{sysid}", sysid)


def vehicle(autopilot: Autopilot = COPTER, sysid: int = 1, *, boot_s: float = 0.0, **trouble: Any) -> LoopbackVehicle:
    return LoopbackVehicle(
        sysid, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0, boot_s=boot_s, misbehave=Misbehaviour(**trouble)
    )


@contextlib.contextmanager
def air(*vehicles: LoopbackVehicle, **link: Any) -> Iterator[Link]:
    """An open link to ``vehicles``."""
    with SimServer(vehicles, "udpin:127.0.0.1:0", speedup=10.0) as server, Link(server.url_for_gcs, **link) as opened:
        yield opened
    assert server.mishandled == 0


@dataclass(frozen=True)
class Verdict:
    """A verdict for the door."""

    safe: bool | None
    mission: Mission


# -- the whole way ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_checked_mission_is_uploaded_and_verified(autopilot: Autopilot) -> None:
    board, sent = vehicle(autopilot), mission(autopilot)
    seen: list[tuple[str, TransferProgress]] = []
    judged: list[Mission] = []

    def judge(read: Mission, _: Mapping[str, float]) -> None:
        judged.append(read)

    with air(board) as link:
        result = upload_mission(
            link, sent, verdict=Verdict(True, sent), options=replace(OPTIONS, unchecked=False, simulated=True),
            judge=judge, progress=lambda name, progress: seen.append((name, progress)),
        )  # fmt: skip
        assert (result.outcome, result.verified, result.error()) == ("accepted", True, None)
        assert result.url == link.url
    assert not faults(compare(sent.wire_items(), board.items(), autopilot))
    assert result.read_back == board.items()
    assert judged == [result.mission]
    assert result.mission is not None
    assert (result.mission.home, result.mission.name, result.mission.sysid) == (sent.home, "uav1", 1)
    assert seen[-1][0] == "uav1"
    assert {p.phase for _, p in seen} == {"upload", "read back"}
    told = json.loads(json.dumps(result.as_dict()))
    assert {"url", "outcome", "verified", "simulated", "items", "seconds", "retries"} <= set(told)
    assert (told["simulated"], told["items"]) == (True, len(sent.wire_items()))


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (lambda m: None, "with its passing verdict"),
        (lambda m: Verdict(False, m), "did not pass"),
        (lambda m: Verdict(None, m), "could not be judged"),
        (lambda m: Verdict(True, mission(count=7)), "another mission"),
        (lambda m: Verdict(True, replace(m, sysid=2)), "another mission"),
    ],
)
def test_nothing_is_sent_without_a_passing_verdict_of_this_mission(
    verdict: Callable[[Mission], Verdict | None], words: str
) -> None:
    board, sent = vehicle(), mission()
    with air(board) as link:
        with pytest.raises(CheckFailed, match=words):
            upload_mission(link, sent, verdict=verdict(sent), options=replace(OPTIONS, unchecked=False))
        other = UploadOrder(link, sent, Verdict(True, sent), replace(OPTIONS, unchecked=False))
        with pytest.raises(CheckFailed):
            upload_fleet([other, UploadOrder(link, mission(sysid=3), verdict(sent), replace(OPTIONS, unchecked=False))])
    assert board.items() == ()


def test_a_mission_that_the_vehicles_own_parameters_make_unsafe_is_not_sent() -> None:
    board, heard = vehicle(Autopilot.PX4), []

    def judge(_: Mission, values: Mapping[str, float]) -> Note | None:
        heard.append(dict(values))
        return CUT_CORNER if values.get("NAV_ACC_RAD") == 2.0 else None

    with air(board) as link, pytest.raises(FailsCheck, match="it was judged with other values") as caught:
        upload_mission(link, mission(Autopilot.PX4), options=replace(OPTIONS, read_parameters=True), judge=judge)
    assert (caught.value.reason, caught.value.note) == ("parameters", CUT_CORNER)
    assert board.items() == ()
    assert heard[0]["NAV_MC_ALT_RAD"] == pytest.approx(0.8)


def test_the_read_back_is_checked_again() -> None:
    silent = Note("parameters_unanswered", names=("ANGLE_MAX or ATC_ANGLE_MAX",))
    with air(vehicle()) as link:
        result = upload_mission(link, mission(), options=OPTIONS, judge=lambda read, values: silent)
    assert not result.verified
    with pytest.raises(CheckFailed, match="ANGLE_MAX or ATC_ANGLE_MAX could not be read"):
        result.raise_for_outcome()
    told = result.as_dict()
    assert (told["failed_check"], told["failed_check_data"]) == (str(silent), silent.as_dict())


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("trouble", "error", "words"),
    [
        ({"corrupt": 4}, ReadBackDiffers, "item 4 .*altitude"),
        ({"corrupt": 3, "corrupt_field": "x"}, ReadBackDiffers, "item 3 .*latitude"),
        ({"edit": 2}, ReadBackDiffers, "item 2 .*altitude"),
        ({"refuse": 5, "refuse_code": 3}, VehicleRefused, "item 5: the command is not supported"),
        ({"no_space": True}, VehicleRefused, "no space"),
        ({"silent_after": 30}, LinkError, "unknown"),
    ],
)
def test_what_goes_wrong_is_caught_and_named(trouble: dict[str, Any], error: type[GcsplanError], words: str) -> None:
    with air(vehicle(**trouble)) as link:
        result = upload_mission(link, mission(count=30), options=replace(OPTIONS, attempts=2))
    assert not result.verified
    assert result.on_board
    with pytest.raises(error, match=words):
        result.raise_for_outcome()


def test_a_reboot_in_the_middle_is_survived() -> None:
    board = vehicle(reboot_at=4, reboot_s=2.0)  # 0.2 s of ours
    with air(board) as link:
        result = upload_mission(link, mission(), options=OPTIONS)
    assert result.verified
    assert result.attempts > 1


# -- before anything is sent --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("board", "sent", "reason", "words"),
    [
        (vehicle(armed=True), mission(), "armed", "--allow-armed"),
        (vehicle(PX4), mission(COPTER), "wrong_autopilot", "written for ArduCopter, and the vehicle is PX4"),
        (vehicle(PLANE), mission(COPTER), "wrong_autopilot", "fixed wing"),
        (vehicle(boot_s=600.0), mission(), "not_ready", "booting"),
        (vehicle(), replace(mission(), home=Home.at(36.6005, -84.38, 371.0)), "wrong_place", "56 m from"),
        (vehicle(), replace(mission(), home=Home.at(36.6, -84.38, 351.0)), "wrong_height", r"\+20.0 m"),
    ],
)
def test_a_vehicle_that_does_not_fit_gets_nothing(
    board: LoopbackVehicle, sent: Mission, reason: str, words: str
) -> None:
    with air(board) as link, pytest.raises(VehicleRefused, match=words) as refused:
        upload_mission(link, sent, options=OPTIONS)
    assert refused.value.reason == reason
    assert refused.value.exit_code == 5
    assert board.items() == ()


def test_what_may_be_overridden_is_taken_with_a_warning() -> None:
    board, sent = vehicle(armed=True), replace(mission(), home=Home.at(40.0, -84.38, 371.0))
    with air(board) as link:
        result = upload_mission(link, sent, options=replace(OPTIONS, allow_armed=True, ignore_position=True))
    assert result.verified
    assert Note("armed_as_allowed") in result.warnings
    assert any(w.code.startswith("home_on_board_elsewhere") for w in result.warnings)


def test_the_ground_that_the_caller_gives_counts() -> None:
    sent = replace(mission(), home=Home.at(36.6, -84.38, 340.0))
    with air(vehicle()) as link, pytest.raises(VehicleRefused) as refused:
        upload_mission(link, sent, options=OPTIONS)
    assert refused.value.reason == "wrong_height"
    with air(vehicle()) as link:
        assert upload_mission(link, sent, options=replace(OPTIONS, ground_amsl_m=370.0)).verified


def test_a_vehicle_that_is_booting_is_waited_for() -> None:
    board = vehicle(boot_s=5.0)  # half a second of ours
    with air(board) as link:
        assert upload_mission(link, mission(), options=replace(OPTIONS, standby_s=8.0)).verified
    assert len(board.items()[1:]) == len(mission().items)


def test_two_vehicles_with_one_number_are_refused() -> None:
    first, second = vehicle(), vehicle()
    with Link("udpin:127.0.0.1:0") as link:
        port = link.place.rsplit(":", 1)[1]
        with (
            SimServer([first], f"udpout:127.0.0.1:{port}", speedup=10.0),
            SimServer([second], f"udpout:127.0.0.1:{port}", speedup=10.0),
            pytest.raises(VehicleRefused, match="2 autopilots speak as system 1"),
        ):
            upload_mission(link, mission(), options=replace(OPTIONS, listen_s=0.5))
    assert first.items() == second.items() == ()


def test_a_dead_link_says_which_direction_was_tried_and_names_the_other() -> None:
    with Link("udpin:127.0.0.1:0") as link, pytest.raises(LinkError) as dead:
        discover(link, 1, 0.2)
    assert "udpin: listens on 127.0.0.1" in str(dead.value)
    assert "udpout:127.0.0.1" in str(dead.value)
    assert dead.value.exit_code == 6


def test_a_silent_vehicle_may_have_another_partner() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        place = f"127.0.0.1:{silent.getsockname()[1]}"
        with Link(f"udpout:{place}") as link, pytest.raises(LinkError) as dead:
            discover(link, 1, 0.2)
        assert f"sends to {place} from port {link.endpoint.sends_from}" in str(dead.value)
        assert "answers only the address and port that it heard first" in str(dead.value)
        assert f"udpin:{place} (listens)" in str(dead.value)
        with Link(f"udpout:{place}"), Link(f"udpout:{place}") as second, pytest.raises(LinkError) as dead:
            discover(second, 1, 0.2)
        assert "a program uses" in str(dead.value)


def test_the_wrong_number_is_told_with_the_numbers_that_are_there() -> None:
    with air(vehicle(sysid=7), vehicle(sysid=9)) as link, pytest.raises(LinkError, match="systems heard there: 7, 9"):
        discover(link, 1, 0.5)


def test_unsigned_frames_are_told_as_the_reason() -> None:
    with air(vehicle(), key=SigningKey(bytes(32))) as link, pytest.raises(LinkError, match="valid signature") as dead:
        discover(link, 1, 0.5)
    assert "00000000" not in str(dead.value)


def test_a_vehicle_tells_what_it_is_and_where() -> None:
    with air(vehicle(PX4)) as link:
        state = discover(link, 1, listen_s=0.0)
    assert (state.address, state.armed, state.system_status, state.sources) == (Address(1, 1), False, STANDBY, 1)
    assert "PX4" in state.what
    assert state.lat_deg == pytest.approx(36.6)
    assert state.amsl_m == pytest.approx(371.0)
    assert state.can(4) is True
    assert state.can(512) is False


def beat(compid: int, kind: int, autopilot: int, peer: str = "a", now: float = 0.0) -> tuple[Heard, float]:
    message = dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, STANDBY, 3)
    return Heard(Address(1, compid), peer, message), now


def test_cameras_companions_and_ground_stations_are_no_rivals() -> None:
    watch = Watch(1)
    for compid, kind in ((100, 30), (154, 26), (191, 18), (190, 6)):
        watch.note(*beat(compid, kind, 8))
        assert watch.state(0.0) is None
    watch.note(*beat(1, 2, 3))
    state = watch.state(0.0)
    assert state is not None
    assert (state.address, state.sources) == (Address(1, 1), 1)


def test_one_number_from_two_places_or_two_autopilots_under_one_number_are_counted() -> None:
    watch = Watch(1)
    watch.note(*beat(1, 2, 3, "a"))
    watch.note(*beat(1, 2, 3, "b"))
    assert getattr(watch.state(0.0), "sources", 0) == 2
    watch.note(*beat(1, 2, 3, "b", 10.0))
    assert getattr(watch.state(10.0), "sources", 0) == 2  # the other is silent, but they were there together
    watch.note(*beat(2, 2, 12, "b", 10.0))
    assert getattr(watch.state(10.0), "sources", 0) == 3


def test_what_a_vehicle_says_is_kept_in_bounds() -> None:
    watch = Watch(1)
    for n in range(100):
        text = dialect.MAVLink_statustext_message(6, f"text\x07 {n}".encode())
        watch.note(Heard(Address(1, 1), "a", text), 0.0)
        watch.note(*beat(1, 2, 3, f"peer {n}"))
    assert watch.texts_since(98) == ("text 98", "text 99")
    assert len(watch.texts_since(0)) == len(watch.texts) < 100
    assert getattr(watch.state(0.0), "sources", 0) < 100


# -- preflight alone ----------------------------------------------------------------------------------------------

READY = VehicleState(Address(1, 1), 3, 2, False, STANDBY, 36.6, -84.38, 371.0, 4 | 512 | 16384 | 32768)


def warnings_of(state: VehicleState, **more: Any) -> str:
    return " / ".join(map(str, preflight(state, mission().wire_items(), COPTER, start=HOME, **more)))


def test_a_vehicle_that_fits_draws_no_warning() -> None:
    assert warnings_of(READY) == ""


def test_a_vehicle_that_answers_in_mavlink_1_is_told_so_and_gets_no_fence() -> None:
    old = replace(READY, mavlink1=True)
    assert "only MAVLink 1 comes back from the vehicle: set SERIALn_PROTOCOL 2" in warnings_of(old)
    for kind, words in ((FENCE, "no fence can be sent"), (RALLY, "no rally points can be sent")):
        with pytest.raises(VehicleRefused, match=words) as refused:
            preflight(old, (), COPTER, mission_type=kind)
        assert refused.value.reason == "mavlink1"


def test_an_autopilot_without_a_position_is_refused_unless_that_is_ignored() -> None:
    lost = replace(READY, lat_deg=None, lon_deg=None, amsl_m=None)
    with pytest.raises(VehicleRefused, match="reports no position") as refused:
        warnings_of(lost)
    assert refused.value.reason == "no_position"
    assert warnings_of(lost, ignore_position=True) == ""


def test_what_else_a_fence_puts_into_force_is_told() -> None:
    values = {
        "FENCE_ENABLE": 0.0,
        "FENCE_TYPE": 7.0,
        "FENCE_RADIUS": 150.0,
        "FENCE_ALT_MAX": 100.0,
        "FENCE_ACTION": 1.0,
    }
    [told] = judge_fence_parameters(values)
    assert "also puts into force the circle of 150 m around home (FENCE_RADIUS; FENCE_TYPE 7)" in str(told)
    assert "the ceiling at 100 m above home (FENCE_ALT_MAX; FENCE_TYPE 7)" in str(told)
    [alone] = judge_fence_parameters(values | {"FENCE_TYPE": 4.0})
    assert alone == Note("fence_not_enforced")
    [unread] = judge_fence_parameters({"FENCE_ENABLE": 0.0})
    assert unread.data["others"] == (Note("fence_type_unread"),)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mav_autopilot": 0, "mav_type": 0, "system_status": UNINIT}, "could not be checked"),
        ({"mav_autopilot": 8, "mav_type": 2}, "calls itself"),
        ({"mav_type": 0}, "does not say whether"),
        ({"mav_autopilot": 8, "lat_deg": None, "lon_deg": None, "amsl_m": None}, "reports no position"),
        ({"capabilities": None}, "capabilities"),
        ({"capabilities": 0}, "MISSION_ITEM_INT"),
        ({"system_status": CRITICAL}, "critical"),
    ],
)
def test_what_is_not_reported_is_taken_with_a_warning(change: dict[str, Any], words: str) -> None:
    assert words in warnings_of(replace(READY, **change))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"system_status": UNINIT}, "not_ready"),
        ({"system_status": BOOT}, "not_ready"),
        ({"system_status": POWEROFF}, "not_ready"),
        ({"sources": 2}, "ambiguous"),
        ({"armed": True}, "armed"),
        ({"mav_type": 10}, "wrong_autopilot"),
    ],
)
def test_what_speaks_against_an_upload_refuses_it(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(VehicleRefused) as refused:
        warnings_of(replace(READY, **change))
    assert refused.value.reason == reason


@pytest.mark.parametrize("mav_type", [1, 22])
def test_a_judged_mission_goes_to_no_px4_that_is_a_fixed_wing_or_a_vtol(mav_type: int) -> None:
    state = replace(READY, mav_autopilot=12, mav_type=mav_type, flight_sw_version=PX4_17)
    items = mission(PX4).wire_items()
    with pytest.raises(VehicleRefused, match="does not fly as a mission for PX4 is judged") as refused:
        preflight(state, items, PX4, judged=True)
    assert (refused.value.reason, refused.value.exit_code) == ("wrong_autopilot", 5)
    assert preflight(state, items, PX4) == []  # unchecked
    assert preflight(replace(state, mav_type=2), items, PX4, judged=True) == []


def test_all_reasons_are_told_at_once() -> None:
    state = replace(READY, armed=True, lat_deg=40.0, sources=3, system_status=BOOT)
    with pytest.raises(VehicleRefused, match=r"3 autopilots.*booting.*armed.*m from the mission's start"):
        warnings_of(state)


PX4_17, PX4_18 = int.from_bytes([1, 17, 0, 255], "big"), int.from_bytes([1, 18, 0, 128], "big")


@pytest.mark.parametrize("version", [PX4_18, None, 0])
def test_a_judged_mission_goes_to_no_px4_that_may_not_fly_straight_legs(version: int | None) -> None:
    state = replace(READY, mav_autopilot=12, flight_sw_version=version)
    items = mission(PX4).wire_items()
    with pytest.raises(VehicleRefused, match="may change its altitude at the beginning of a leg") as refused:
        preflight(state, items, PX4, judged=True)
    assert (refused.value.reason, refused.value.exit_code) == ("firmware", 5)
    assert "fly on (upstream issue 28507)" in " / ".join(map(str, preflight(state, items, PX4)))  # unchecked: a warning
    assert preflight(replace(state, flight_sw_version=PX4_17), items, PX4, judged=True) == []
    level = [replace(item, z=65.0) for item in items]
    assert preflight(state, level, PX4, judged=True) == []
    assert preflight(state, [MissionItem(5004, 0)], PX4, mission_type=FENCE, judged=True) == []


def test_what_a_px4_says_of_its_version_decides_an_upload(monkeypatch: pytest.MonkeyPatch) -> None:
    board, sent = vehicle(PX4), mission(PX4)
    with air(board) as link:
        found = discover(link, 1, listen_s=0.0)
        assert flies_straight(found.flight_sw_version)
        monkeypatch.setattr("gcsplan.mavlink.mission.autopilots.STRAIGHT_UNTIL", (1, 9))
        with pytest.raises(VehicleRefused, match="the vehicle is PX4 1"):
            upload_mission(link, sent, options=OPTIONS, judge=lambda read, values: None)
        assert board.items() == ()
        upload_mission(link, sent, options=OPTIONS).raise_for_outcome()


def test_too_many_items_are_refused_before_they_are_sent() -> None:
    with pytest.raises(VehicleRefused, match="at most 650 items and the list has 651"):
        preflight(READY, mission(count=650).wire_items(), COPTER)


def test_a_vehicle_without_a_fence_gets_none() -> None:
    with pytest.raises(VehicleRefused, match="keeps no fence"):
        preflight(replace(READY, capabilities=4), [MissionItem(5004, 0)], COPTER, mission_type=FENCE)


@pytest.mark.parametrize(("north_m", "up_m", "fits"), [(29.0, 14.0, True), (31.0, 0.0, False), (0.0, -16.0, False)])
def test_thirty_metres_aside_and_fifteen_in_height_are_allowed(north_m: float, up_m: float, fits: bool) -> None:
    state = replace(READY, lat_deg=36.6 + north_m / 111_195.0, amsl_m=371.0 + up_m)
    with contextlib.nullcontext() if fits else pytest.raises(VehicleRefused):
        warnings_of(state)
    assert warnings_of(state, ignore_position=True) == ""


# -- parameters ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_return_and_failsafe_parameters_are_read_and_their_difference_reported(
    autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(steps, "PARAMETER_S", 0.5)  # an old ArduPlane says nothing of one that it does not have
    board = vehicle(autopilot)
    with air(board) as link:
        options = replace(OPTIONS, read_parameters=True, rtl_rel_home_m=333.0, expected_parameters={"NO_SUCH": 1.0})
        result = upload_mission(link, mission(autopilot), options=options)
    assert result.verified
    words = " / ".join(map(str, result.warnings))
    assert "was checked at 333 m" in words
    assert "NO_SUCH could not be read" in words


def test_parameters_that_fit_say_nothing() -> None:
    values = {
        "RTL_ALT": 6000.0,
        "FENCE_ENABLE": 0.0,
        "FS_THR_ENABLE": 1.0,
        "FS_GCS_ENABLE": 1.0,
        "BATT_FS_LOW_ACT": 2.0,
        "RTL_LOIT_TIME": 5000.0,
        "RTL_ALT_FINAL": 0.0,
    }
    assert judge_parameters(values, mission(), rtl_rel_home_m=60.0) == []


def test_a_return_along_the_mission_does_not_wait_over_home() -> None:
    values = {"FS_THR_ENABLE": 6.0, "RTL_LOIT_TIME": 0.0, "RTL_ALT_FINAL": 1000.0}
    assert judge_parameters(values, mission(), route="mission") == []


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "no parameters could be read"),
        ({"RTL_ALT": 1500.0}, "return is at 15 m above home (RTL_ALT), but was checked at 60 m"),
        ({"RTL_ALT_M": 15.0}, "return is at 15 m above home (RTL_ALT_M)"),
        (
            {"RTL_ALT": 6000.0, "FENCE_ENABLE": 1.0, "FENCE_TYPE": 1.0, "FENCE_ALT_MAX": 66.0},
            "ends at 66 m (FENCE_ALT_MAX)",
        ),
        (
            {"RTL_ALT": 6000.0, "FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0, "FENCE_RADIUS": 5.0},
            "ends at 5 m (FENCE_RADIUS)",
        ),
        ({"RTL_RETURN_ALT": 60.0, "GF_ACTION": 1.0, "GF_MAX_VER_DIST": 50.0}, "ends at 50 m (GF_MAX_VER_DIST)"),
        ({"RTL_ALT": 6000.0, "RTL_LOIT_TIME": 20000.0}, "waits 20 s over home before it descends, and times and"),
        ({"RTL_ALT": 6000.0, "RTL_LOIT_TIME": 0.0}, "RTL_LOIT_TIME is 0 on board: a return waits 0 s"),
        ({"RTL_ALT": 6000.0, "RTL_ALT_FINAL": 1000.0}, "ends in a hover 10 m above home, until"),
        ({"RTL_ALT_M": 60.0, "RTL_ALT_FINAL_M": 10.0}, "ends in a hover 10 m above home, until"),
        ({"RTL_RETURN_ALT": 60.0, "RTL_TYPE": 2.0}, "RTL_TYPE is 2 on board: the return is not straight home"),
        ({"RTL_RETURN_ALT": 60.0, "RTL_CONE_ANG": 80.0}, "RTL_CONE_ANG is 80 on board"),
        ({"RTL_RETURN_ALT": 60.0, "NAV_DLL_ACT": 0.0}, "no failsafe action on board for loss of the ground station"),
    ],
)
def test_parameters_that_do_not_fit_are_told_in_words(values: dict[str, float], words: str) -> None:
    autopilot = Autopilot.PX4 if "RTL_RETURN_ALT" in values else Autopilot.ARDUCOPTER
    assert words in " / ".join(map(str, judge_parameters(values, mission(autopilot), rtl_rel_home_m=60.0)))


def test_a_plane_that_climbs_out_more_steeply_than_was_judged_is_told() -> None:
    climbs = replace(mission(PLANE), items=(MissionItem(22, 3, (8.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000, 80.0),))
    assert judge_parameters({"TECS_PITCH_MAX": 15.0}, climbs) == []
    for pitch_deg in (25.0, 0.0):
        [told] = judge_parameters({"TECS_PITCH_MAX": pitch_deg}, climbs)
        assert told == Note("pitch_not_flown", value=pitch_deg, flown_deg=15.0, judged_m=16.0)
        assert judge_parameters({"TECS_PITCH_MAX": pitch_deg}, mission(PLANE)) == []


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"RTL_ALT": 6000.0}, "the return is at 60 m above home (RTL_ALT), as judged: set RTL_ALT 35300 (cm)"),
        ({"RTL_ALT_M": 60.0}, "the return is at 60 m above home (RTL_ALT_M), as judged: set RTL_ALT_M 353 (m)"),
        ({"RTL_ALT": 1500.0}, ", but was checked at 60 m: set RTL_ALT 35300 (cm)"),
    ],
)
def test_a_better_return_altitude_is_told_by_the_vehicles_own_name(values: dict[str, float], words: str) -> None:
    [told] = judge_parameters(values, mission(), rtl_rel_home_m=60.0, advised_rel_home_m=353.0)
    assert str(told).endswith(words)


def test_a_return_that_nobody_checked_is_told() -> None:
    assert judge_parameters({"RTL_ALT": 1500.0}, mission())[0].code == "return_not_checked"


# -- fleets -------------------------------------------------------------------------------------------------------


# -- download, verify, clear, fence, rally ------------------------------------------------------------------------
