"""What a vehicle says of itself: who is one, who is two, and which numbers are none."""

from __future__ import annotations

import math
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.mavlink.link.frames import FrameParser
from gcsplan.mavlink.link.link import Heard
from gcsplan.mavlink.link.options import TransferPatience
from gcsplan.mavlink.link.session.parameters import decode_value, judge_fence_parameters, judge_parameters
from gcsplan.mavlink.link.watch import STANDBY, VehicleState, Watch, finite, place, whole
from gcsplan.mavlink.protocol.messages import Address
from tests.mavlink.link.session.test_session import mission

ODD = (math.nan, math.inf, -math.inf, 3.4e38, -1.0, 1e-40, 2.0**31)


def beat(*, compid: int = 1, peer: str = "a", armed: bool = False, autopilot: int = 3, kind: int = 2) -> Heard:
    message = dialect.MAVLink_heartbeat_message(kind, autopilot, 128 if armed else 0, 0, STANDBY, 3)
    return Heard(Address(1, compid), peer, message)


def at(boot_s: float, lat_e7: int = 366_000_000, *, peer: str = "a") -> Heard:
    message = dialect.MAVLink_global_position_int_message(
        round(boot_s * 1e3), lat_e7, -843_800_000, 371_000, 0, 0, 0, 0, 0
    )
    return Heard(Address(1, 1), peer, message)


def seen(*said: tuple[float, Heard], now: float | None = None) -> VehicleState:
    watch = Watch(1)
    watch.note(beat(), 0.0)
    for when, heard in said:
        watch.note(heard, when)
    state = watch.state(said[-1][0] if now is None else now)
    assert state is not None
    return state


@pytest.mark.parametrize(
    ("clocks", "two"),
    [
        ([(0, 100.0), (1, 101.0), (2, 102.0)], False),
        ([(0, 100.0), (1, 0.5), (2, 1.5), (30, 29.5)], False),  # it has rebooted
        ([(0, 100.0), (1, 101.0), (1.01, 100.2), (2, 102.0)], False),  # overtaken on the way
        ([(0, 100.0), (200, 300.0), (201, 301.0)], False),  # not heard for long
        ([(0, 100.0), (10, 101.0), (10, 102.0), (10, 110.0)], False),  # we were busy, and then read all of it
        ([(0, 100.0), (0.5, 400.0), (1, 101.0)], True),
        ([(0, 400.0), (0.5, 100.0), (1, 401.0)], True),
        ([(0, 130.0), (9, 104.5), (10, 140.0)], True),  # most of it was lost
    ],
)  # fmt: skip
def test_two_boot_clocks_at_one_address_are_two_vehicles(clocks: list[tuple[float, float]], two: bool) -> None:
    state = seen(*((when, at(boot)) for when, boot in clocks), *((when, beat()) for when, _ in clocks[-1:]))
    assert (state.sources > 1) == two


def test_two_places_by_turns_are_two_vehicles_and_one_leap_is_none() -> None:
    near, far = 366_000_000, 369_000_000
    once = seen((0.0, at(5.0, near)), (1.0, at(6.0, far)))
    assert (once.sources, once.lat_deg) == (1, 36.9)
    assert once.just_at is not None
    assert once.just_at.lat_deg == 36.6
    assert seen((0.0, at(5.0, near)), (1.0, at(6.0, far)), (9.0, at(14.0, far))).just_at is None
    assert seen((0.0, at(5.0, near)), (1.0, at(6.0, far)), (2.0, at(7.0, near))).sources == 2


def test_two_kinds_at_one_address_are_two_vehicles() -> None:
    assert seen((0.5, beat(autopilot=12)), (1.0, beat())).sources == 2
    assert seen((0.5, beat(kind=1)), (1.0, beat())).sources == 2


def test_armed_counts_for_some_seconds_whoever_says_otherwise() -> None:
    assert seen((0.5, beat(armed=True)), (1.0, beat())).armed
    assert not seen((0.5, beat(armed=True)), (4.0, beat())).armed


def test_what_comes_late_counts_against_and_never_for() -> None:
    late = Heard(Address(1, 1), "a", at(5.0, 369_000_000).message, late=True)
    state = seen((0.0, at(5.0)), (1.0, late), (1.1, at(6.1)))
    assert (state.lat_deg, state.sources) == (36.6, 2)
    state = seen((1.0, Heard(Address(1, 1), "a", beat(armed=True).message, late=True)))
    assert state.armed
    watch = Watch(1)
    watch.note(Heard(Address(1, 1), "a", beat().message, late=True), 0.0)
    assert watch.state(0.0) is None


def test_the_last_frame_tells_whether_mavlink_2_comes_back() -> None:
    us = dialect.MAVLink(None, 1, 1)
    watch = Watch(1)
    for now, old in ((0.0, True), (1.0, False), (2.0, True)):
        frame = beat().message.pack(us, force_mavlink1=old)
        (message,) = FrameParser().feed(frame)
        watch.note(Heard(Address(1, 1), "a", message), now)
        state = watch.state(now)
        assert state is not None
        assert state.mavlink1 is old


def test_one_without_heartbeats_is_a_rival_all_the_same() -> None:
    assert seen((0.2, at(5.0, peer="b")), (1.0, beat())).sources == 2


def told(compid: int, peer: str = "a") -> Heard:
    return Heard(Address(1, compid), peer, dialect.MAVLink_statustext_message(6, b"here"))


def test_a_pilot_whose_heartbeats_get_lost_is_a_rival_while_it_says_anything() -> None:
    """Of the other one the only heartbeat came before the first of ours; what it says later shows that it stayed."""
    for later, sources in ((told(2), 2), (told(1), 1)):
        watch = Watch(1)
        watch.note(beat(compid=2), 0.0)
        watch.note(beat(), 1.0)
        watch.note(later, 2.0)
        state = watch.state(2.0)
        assert state is not None
        assert (state.address.compid, state.sources) == (1, sources)


def test_a_pinned_vehicle_that_says_anything_beside_a_newcomer_is_one_of_two() -> None:
    watch = Watch(1)
    watch.note(beat(), 0.0)
    state = watch.state(0.0)
    assert state is not None
    watch.pin(state, 1.0)
    assert not watch.contested
    watch.note(told(190), 1.5)  # a camera that is no autopilot
    assert not watch.contested
    watch.note(beat(compid=2), 2.0)
    assert watch.contested
    assert watch.alike()  # ours may have gone
    watch.note(told(1), 2.1)
    assert not watch.alike()


@pytest.mark.parametrize("odd", [*ODD, 10**400, "x", None, b"\0"])
def test_numbers_that_are_none_are_told_from_those_that_are(odd: Any) -> None:
    number = finite(odd)
    assert number is None or math.isfinite(number)
    counted = whole(odd, 0, 100)
    assert counted is None or 0 <= counted <= 100


@pytest.mark.parametrize(
    "where", [(0, 0, 0), (900_000_001, 0, 0), (1, 1_800_000_001, 0), (-(2**31), 1, 1), (1, 1, 2**31), (1, 1, math.nan)]
)
def test_places_that_are_none_on_earth_are_none(where: tuple[Any, ...]) -> None:
    assert place(*where) is None
    assert place(1, 1, 5000) == (1e-7, 1e-7, 5.0)


@pytest.mark.parametrize("value", ODD)
@pytest.mark.parametrize("kind", [0, 1, 2, 5, 6, 9, 10, 255])
@pytest.mark.parametrize("autopilot", [0, 3, 12])
def test_no_parameter_on_board_breaks_the_judgement(value: float, kind: int, autopilot: int) -> None:
    message = dialect.MAVLink_param_value_message(b"FENCE_TYPE", value, kind, 1, 0)
    number = decode_value(message, autopilot)
    names = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ALT_MAX", "FENCE_RADIUS", "RTL_ALT", "GF_ACTION", "GF_MAX_VER_DIST")
    found = judge_parameters(dict.fromkeys(names, number), mission(), rtl_rel_home_m=60.0, expected={"RTL_ALT": 1.0})
    found += judge_fence_parameters(dict.fromkeys(names, number))
    assert math.isfinite(number) or any(note.code == "parameter_is_no_number" for note in found)


def test_patience_ends_without_progress_and_after_two_seconds_an_item() -> None:
    stuck = TransferPatience(10.0, 5, 0.0)
    assert stuck.over((1,), 5, 9.9) is None
    assert "nothing new" in (stuck.over((1,), 5, 19.9) or "")
    slow = TransferPatience(10.0, 5, 0.0)
    assert [slow.over((n,), 5, 4.0 * n) is None for n in range(6)] == [True] * 5 + [False]
    unknown = TransferPatience(10.0, None, 0.0)
    assert all(unknown.over((n,), 100, 4.0 * n) is None for n in range(50))


def of_wind(speed_m_s: float, from_deg: float) -> Heard:
    return Heard(Address(1, 1), "a", dialect.MAVLink_wind_message(from_deg, speed_m_s, 0.0))


def of_cov(north_m_s: float, east_m_s: float, variance: float) -> Heard:
    message = dialect.MAVLink_wind_cov_message(0, north_m_s, east_m_s, 0.0, variance, 0.0, 0.0, 0.0, 0.0)
    return Heard(Address(1, 1), "a", message)


def test_the_wind_is_the_one_that_either_autopilot_says() -> None:
    both = [seen((0.1, of_wind(5.0, -90.0))).wind, seen((0.1, of_cov(0.0, 5.0, 0.25))).wind]
    for wind in both:
        assert wind is not None
        assert wind.speed_m_s == pytest.approx(5.0)
        assert wind.from_deg == pytest.approx(270.0)
    assert [wind.deviation_m_s for wind in both if wind] == [0.0, 0.5]


@pytest.mark.parametrize("value", ODD)
def test_no_wind_is_made_of_odd_numbers_or_of_a_filter_that_has_none(value: float) -> None:
    assert seen((0.1, of_wind(math.nan, value))).wind is None
    assert seen((0.1, of_wind(value, math.nan))).wind is None
    assert seen((0.1, of_cov(value if abs(value) > 100.0 else math.nan, 0.0, 0.0))).wind is None
    assert seen((0.1, of_wind(0.0, 180.0))).wind is None
    assert seen((0.1, of_cov(3.0, 3.0, 9.1))).wind is None  # 3 m/s of deviation
    assert seen((0.1, of_wind(101.0, 0.0))).wind is None
