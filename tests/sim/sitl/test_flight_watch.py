"""Why a vehicle in SITL did not arrive, from what it says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from gcsplan.notes.note import Note
from gcsplan.sim.sitl.flight_watch import FlightWatch
from tests.support.sitl_parts import a_part, ramp


def text(words: str, severity: int = 6) -> Any:
    return SimpleNamespace(get_type=lambda: "STATUSTEXT", text=words, severity=severity)


def beat(mode: int) -> Any:
    return SimpleNamespace(get_type=lambda: "HEARTBEAT", custom_mode=mode)


def test_ground_that_is_hit_on_the_way_ends_the_flight_with_its_cause() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(beat(3), 1)
    watch.note(text("SIM Hit ground at 0.9 m/s"), 1)  # at take-off
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 0.01 m/s"), 2)
    assert not watch.crashed
    watch.note(text("SIM Hit ground at 1.502964 m/s"), 2)
    assert watch.crashed
    [hit] = watch.why()
    assert (hit.code, hit.item) == ("hit_ground", 2)
    assert str(hit) == "it hit the ground at 1.5 m/s on its way to item 2"
    assert watch.why(90.0) == (hit, Note("other_ground", height_m=90.0))


def test_a_landing_touches_the_ground() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("SIM Hit ground at 0.6 m/s"), 3)
    assert not watch.crashed
    assert watch.why(90.0) == ()


def test_a_failsafe_is_named_with_what_the_vehicle_said() -> None:
    watch = FlightWatch(a_part(ramp()).mission)
    watch.note(text("Reached command #1"), 1)
    watch.note(text("Battery Failsafe", 4), 2)
    watch.note(beat(3), 2)
    watch.note(beat(6), 2)
    watch.note(beat(9), 2)
    watch.timed_out = True
    assert watch.why() == (
        Note("left_auto", 2, mode="RTL"), Note("time_was_up", 2), Note("vehicle_said", texts="Battery Failsafe"),
    )  # fmt: skip
    never = Note("never_arrived_for", name="uav1", why=watch.why())
    assert str(never) == (
        "uav1 never arrived at its goal: it left AUTO for RTL at item 2, it still flew to item 2 when the time was up, "
        "it sent: Battery Failsafe"
    )
