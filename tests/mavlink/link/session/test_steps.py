"""Finding a vehicle and reading its parameters, in simulated time: what is asked, how often, and when it ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.mavlink.link.link import Channel, Heard, Link, LinkSteps
from gcsplan.mavlink.link.session.steps import discover_steps, parameter_steps
from gcsplan.mavlink.link.watch import STANDBY, UNINIT, VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import ARDUPILOTMEGA, GENERIC
from gcsplan.mavlink.mission.parameter_names import OnBoard, unanswered
from gcsplan.mavlink.protocol.messages import Address

T = TypeVar("T")
VEHICLE = Address(1, 1)
POSITION, CAPABILITIES = 33, 148


class Air:
    """A link without a socket or a clock: ``answer`` gives what a vehicle says to a message."""

    def __init__(self, answer: Callable[[Any], Sequence[Any]], autopilot: int) -> None:
        self.now = 100.0
        self.sent: list[Any] = []
        self.channel = Channel(cast(Link, self), VEHICLE.sysid)
        self._answer, self._autopilot = answer, autopilot
        self._beat_at = 100.25

    def clock(self) -> float:
        return self.now

    def send(self, message: Any, to: Address) -> bool:
        self.sent.append(message)
        for answer in self._answer(message):
            self.say(answer)
        return True

    def say(self, message: Any, source: Address = VEHICLE) -> None:
        self.channel.inbox.append(Heard(source, "peer", message))

    def run(self, steps: LinkSteps[T]) -> T:
        """To the end of ``steps``, with a heartbeat each second."""
        try:
            for _ in range(1000):
                until = next(steps)
                if not self.channel.inbox:
                    self.now = min(until, self._beat_at)
                    if self.now == self._beat_at:
                        self._beat_at += 1.0
                        status = UNINIT if self._autopilot == GENERIC else STANDBY
                        self.say(dialect.MAVLink_heartbeat_message(2, self._autopilot, 0, 0, status, 3))
        except StopIteration as stop:
            result: T = stop.value
            return result
        raise AssertionError("it goes on and on")

    def asked_for(self, kind: int) -> int:
        return sum(int(m.param1) == kind for m in self.sent if m.get_type() == "COMMAND_LONG")


def version() -> Any:
    return dialect.MAVLink_autopilot_version_message(57348, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0)


def place() -> Any:
    return dialect.MAVLink_global_position_int_message(0, 366_000_000, -843_800_000, 371_000, 0, 0, 0, 0, 0)


def answering(*kinds: int) -> Callable[[Any], Sequence[Any]]:
    """Answers to REQUEST_MESSAGE for ``kinds``; silence to the others."""
    made = {POSITION: place, CAPABILITIES: version}
    return lambda message: [made[int(message.param1)]()] if int(message.param1) in kinds else []


@pytest.mark.parametrize(
    ("autopilot", "answers", "times", "lasts_s"),
    [
        (ARDUPILOTMEGA, (POSITION, CAPABILITIES), 1, 0.0),
        (ARDUPILOTMEGA, (CAPABILITIES,), 4, 2.0),  # an autopilot's position is worth waiting for
        (GENERIC, (CAPABILITIES,), 2, 1.0),  # a generic one's, if it has any, is asked for twice
        (GENERIC, (), 2, 1.0),
        (GENERIC, (POSITION, CAPABILITIES), 1, 0.0),
    ],
)
def test_how_often_a_position_is_asked_for(
    autopilot: int, answers: tuple[int, ...], times: int, lasts_s: float
) -> None:
    air = Air(answering(*answers), autopilot)
    state = air.run(discover_steps(air.channel, Watch(1), timeout_s=5.0, listen_s=0.0))
    assert state.located is (POSITION in answers)
    assert air.asked_for(POSITION) == times
    assert air.now - 100.25 == pytest.approx(lasts_s)


def ended(steps: LinkSteps[T], air: Air, waiting: list[tuple[float, Any]]) -> T:
    """The result of ``steps``, with answers that wait until their time has come."""
    try:
        until = next(steps)
        for _ in range(2000):
            air.now = max(air.now, min([until, *(at for at, _ in waiting)]))
            for at, answer in [w for w in waiting if w[0] <= air.now]:
                waiting.remove((at, answer))
                air.say(answer)
            until = next(steps)
    except StopIteration as stop:
        result: T = stop.value
        return result
    raise AssertionError("it goes on and on")


@pytest.mark.parametrize("kinds", [(POSITION, CAPABILITIES), (CAPABILITIES,)])
def test_capabilities_come_over_a_round_trip_of_two_seconds(kinds: tuple[int, ...]) -> None:
    """The position comes with them; what never comes is not waited for any longer."""
    waiting: list[tuple[float, Any]] = []
    known = answering(*kinds)

    def asked(message: Any) -> Sequence[Any]:
        waiting.extend((air.now + 2.05, answer) for answer in known(message))
        return []

    air = Air(asked, ARDUPILOTMEGA)
    steps = discover_steps(air.channel, Watch(1), timeout_s=5.0, listen_s=0.0)
    next(steps)
    air.say(dialect.MAVLink_heartbeat_message(2, ARDUPILOTMEGA, 0, 0, STANDBY, 3))
    state = ended(steps, air, waiting)
    assert state.capabilities == 57348
    assert state.located is (POSITION in kinds)
    assert state.round_trip_s == pytest.approx(2.05)
    assert air.now - 100.0 <= 2.05 + 0.5 + 1e-6


def test_parameters_that_decide_nothing_are_read_over_a_slow_link_too() -> None:
    slow = replace(STATE, round_trip_s=2.05)
    values, took_s = late(2.05, lambda name: [value(name, 7.0)], state=slow)
    assert {"FENCE_ENABLE", "FENCE_TYPE"} <= set(values)
    assert took_s == pytest.approx(2.05, abs=0.01)


def test_rivals_are_listened_for_all_the_same() -> None:
    air = Air(answering(CAPABILITIES), GENERIC)
    air.run(discover_steps(air.channel, Watch(1), timeout_s=5.0, listen_s=1.5))
    assert air.now - 100.25 == pytest.approx(1.5)


# -- parameters ---------------------------------------------------------------------------------------------------

STATE = VehicleState(VEHICLE, ARDUPILOTMEGA, 2, False, STANDBY)
GROUPS = (("RTL_ALT", "RTL_ALT_M"), ("FENCE_ENABLE",), ("FENCE_TYPE",))


def value(name: str, number: float) -> Any:
    return dialect.MAVLink_param_value_message(name.encode(), number, dialect.MAV_PARAM_TYPE_REAL32, 1, 0)


def error(name: str, code: int) -> Any:
    return dialect.MAVLink_param_error_message(255, 190, name.encode(), -1, code)


def name_of(message: Any) -> str:
    return str(message.param_id if isinstance(message.param_id, str) else message.param_id.decode())


def read(answer: Callable[[str], Sequence[Any]]) -> tuple[dict[str, float], list[str], float]:
    """The values, the names asked for in turn, and the seconds that it took."""
    air = Air(lambda message: answer(name_of(message)), ARDUPILOTMEGA)
    values = air.run(parameter_steps(air.channel, STATE, GROUPS, Watch(1)))
    return values, [name_of(m) for m in air.sent], air.now - 100.0


def test_a_parameter_that_the_vehicle_says_it_has_not_is_not_asked_for_again() -> None:
    values, asked, took_s = read(lambda name: [value(name, 2.0) if name == "RTL_ALT_M" else error(name, 1)])
    assert values == {"RTL_ALT_M": 2.0}
    assert asked == ["RTL_ALT", "RTL_ALT_M", "FENCE_ENABLE", "FENCE_TYPE"]
    assert took_s == 0.0


def test_a_vehicle_that_has_no_parameters_at_all_costs_no_time() -> None:
    values, asked, took_s = read(lambda name: [error(name, 1)])
    assert (values, len(asked), took_s) == ({}, 4, 0.0)


def test_another_error_and_silence_are_asked_again() -> None:
    for answer in (lambda name: [error(name, 3)], lambda name: []):
        values, asked, took_s = read(answer)
        assert values == {}
        assert asked.count("FENCE_ENABLE") == 2
        assert took_s == pytest.approx(1.0)
    values, asked, took_s = read(lambda name: [value(name, 1.0)] if name == "FENCE_TYPE" else [])
    assert values == {"FENCE_TYPE": 1.0}
    assert asked.count("FENCE_ENABLE") == 4
    assert asked.count("FENCE_TYPE") == 1
    assert took_s == pytest.approx(2.0)


def test_what_another_component_says_of_parameters_does_not_count() -> None:
    air = Air(lambda _: [], ARDUPILOTMEGA)
    air.say(error("FENCE_ENABLE", 1), Address(1, 154))
    air.say(value("FENCE_TYPE", 9.0), Address(1, 154))
    assert air.run(parameter_steps(air.channel, STATE, GROUPS, Watch(1))) == {}
    assert [name_of(m) for m in air.sent].count("FENCE_ENABLE") == 2


def late(
    after_s: float, answers: Callable[[str], Sequence[Any]], state: VehicleState | None = None, **more: Any
) -> tuple[Any, float]:
    """What is read over a link whose answers come so much later, and the seconds that it took."""
    waiting: list[tuple[float, Any]] = []

    def asked(message: Any) -> Sequence[Any]:
        waiting.extend((air.now + after_s, answer) for answer in answers(name_of(message)))
        return []

    air = Air(asked, ARDUPILOTMEGA)
    steps = parameter_steps(air.channel, state or STATE, GROUPS, Watch(1), **more)
    return ended(steps, air, waiting), air.now - 100.0


def test_needed_parameters_are_read_over_a_slow_link() -> None:
    for round_trip_s in (1.0, 1.5, 4.0):
        values, took_s = late(round_trip_s, lambda name: [value(name, 7.0)], needed=GROUPS, most_s=20.0)
        assert {"FENCE_ENABLE", "FENCE_TYPE"} <= set(values)
        assert took_s == pytest.approx(round_trip_s, abs=0.01)


def test_needed_parameters_are_asked_for_until_the_timeout_and_silence_is_no_absence() -> None:
    def answers(name: str) -> list[Any]:
        return [error(name, 1)] if name == "FENCE_TYPE" else [] if name == "FENCE_ENABLE" else [value(name, 1.0)]

    values, took_s = late(0.1, answers, needed=(("FENCE_ENABLE",), ("FENCE_TYPE",)), most_s=20.0)
    assert took_s == pytest.approx(20.0)
    assert values.absent == {"FENCE_TYPE"}
    assert unanswered(values, GROUPS) == [("FENCE_ENABLE",)]
    assert unanswered(OnBoard({"FENCE_ENABLE": float("nan")}), GROUPS[1:2]) == [("FENCE_ENABLE",)]
