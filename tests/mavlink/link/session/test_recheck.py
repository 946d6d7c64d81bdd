"""The vehicle that was checked is the one that is written to: held while it changes, in the middle, over real sockets.

Those in simulated time run on the air of the campaign (`tests.campaigns.links`), which mixes all of this and more.
"""

from __future__ import annotations

import contextlib
import random
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.errors import GcsplanError, LinkError, VehicleRefused
from gcsplan.mavlink.link.frames import FrameWriter, Signing, SigningKey
from gcsplan.mavlink.link.link import GCS, Heard, Link
from gcsplan.mavlink.link.session.recheck import Recheck
from gcsplan.mavlink.link.session.session import (
    SessionOptions,
    UploadOrder,
    clear_mission,
    download_items,
    upload_fleet,
    upload_items,
    upload_mission,
    verify_mission,
)
from gcsplan.mavlink.link.watch import Watch
from gcsplan.mavlink.mission.mission import FENCE, Home, Mission, MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.machine import Wait
from gcsplan.mavlink.protocol.messages import Ack, Address, Count, Item, Packet, Request, RequestList
from gcsplan.mavlink.protocol.outcome import Changed
from gcsplan.notes.note import Note
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.campaigns.air import Air, Radio
from tests.campaigns.crafts import Craft, OddParameters
from tests.campaigns.links import CLEAR, COUNT, ITEM
from tests.mavlink.link.session.test_session import HOME, OPTIONS, mission, vehicle
from tests.mavlink.link.test_prepared_answers import Asker, asker

COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4
FAR = Home(HOME.lat_e7 + 3_000_000, HOME.lon_e7, HOME.amsl_m)


class Acting(LoopbackVehicle):
    """Does ``act(self, message)`` before every mission message that it gets."""

    def __init__(
        self, autopilot: Autopilot, act: Callable[[Acting, Any], None], *, boot_s: float = 0.0, **trouble: Any
    ) -> None:
        super().__init__(
            1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0, boot_s=boot_s, misbehave=Misbehaviour(**trouble)
        )  # fmt: skip
        self.act = act
        self.got: list[Any] = []

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        self.got.append(packet.message)
        self.act(self, packet.message)
        return super().receive(packet, now)

    def count(self, kind: type) -> int:
        """How many messages of a kind it got."""
        return sum(type(message) is kind for message in self.got)


def uploaded(board: LoopbackVehicle, **options: Any) -> Any:
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server, Link(server.url_for_gcs) as link:
        return upload_mission(link, mission(board.autopilot), options=replace(OPTIONS, **options))


# -- before another attempt ---------------------------------------------------------------------------------------


def comes_back(change: Callable[[LoopbackVehicle], None]) -> Acting:
    """Reboots at the fourth item, loses what it has, and is changed when it comes back."""

    class Returning(Acting):
        def reboot(self, now: float) -> None:
            super().reboot(now)
            change(self)

    return Returning(COPTER, lambda *_: None, reboot_at=4, reboot_s=2.0, reboot_loses=True)


def arm(board: LoopbackVehicle) -> None:
    board.armed = True


def carry_off(board: LoopbackVehicle) -> None:
    board.carry_to(FAR)


@pytest.mark.parametrize(("change", "word"), [(arm, "armed"), (carry_off, "moved")])
def test_a_vehicle_that_comes_back_changed_gets_no_second_attempt(
    change: Callable[[LoopbackVehicle], None], word: str
) -> None:
    board = comes_back(change)
    result = uploaded(board)
    assert not result.verified
    error = result.error()
    assert isinstance(error, VehicleRefused)
    assert (error.exit_code, error.reason) == (5, word)
    assert result.as_dict()["changed"] == word
    assert "what the vehicle holds is not known" in result.on_board or "holds" in result.on_board
    assert board.count(Count) == 1


@pytest.mark.slow
def test_what_is_allowed_holds_for_every_look() -> None:
    assert uploaded(comes_back(arm), allow_armed=True).error() is None
    assert uploaded(comes_back(carry_off), ignore_position=True).error() is None


def test_one_that_comes_back_as_it_was_gets_another_attempt() -> None:
    board = comes_back(lambda _: None)
    result = uploaded(board)
    assert result.error() is None
    assert result.attempts > 1


# -- after the read-back ------------------------------------------------------------------------------------------


def after_reading(change: Callable[[LoopbackVehicle], None]) -> Acting:
    def act(board: Acting, message: Any) -> None:
        if isinstance(message, Request) and message.seq == len(board.items(message.mission_type)) - 1:
            change(board)  # while the last item is read: a heartbeat from before is heard before the item

    return Acting(PX4, act)


@pytest.mark.parametrize(("change", "word"), [(arm, "armed"), (carry_off, "moved")])
def test_verified_and_then_changed_says_first_that_the_mission_is_on_board(
    change: Callable[[LoopbackVehicle], None], word: str
) -> None:
    board = after_reading(change)
    result = uploaded(board)
    error = result.error()
    assert isinstance(error, VehicleRefused)
    assert error.message.startswith("the new mission IS on board")
    told = result.as_dict()
    assert (told["outcome"], told["verified"], told["changed"]) == ("accepted", True, word)
    assert (error.exit_code, error.reason) == (5, word)
    assert isinstance(board.got[-1], Ack)  # the end of the read-back, and nothing after it


def test_a_change_that_is_allowed_is_none() -> None:
    assert uploaded(after_reading(arm), allow_armed=True).error() is None
    assert uploaded(after_reading(carry_off), ignore_position=True).error() is None


def test_a_fence_is_held_to_the_same() -> None:
    board = after_reading(arm)
    fence = [MissionItem(5004, 3, (50.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000)]
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server, Link(server.url_for_gcs) as link:
        result = upload_items(link, 1, fence, PX4, FENCE, options=OPTIONS)
    assert str(result.error()).startswith("vehicle (system 1): the new fence IS on board")


# -- another vehicle with the same number -------------------------------------------------------------------------


@pytest.mark.slow
def test_a_stranger_with_the_same_number_gets_nothing_though_it_speaks_all_the_time() -> None:
    """Over real sockets, prompt answers included: it appears at the first announcement, armed."""
    stranger = Acting(COPTER, lambda *_: None, armed=True)
    begun = threading.Event()

    def act(board: Acting, message: Any) -> None:
        begun.set()

    board = Acting(COPTER, act)
    with Link("udpin:127.0.0.1:0") as link:
        port = link.place.rsplit(":", 1)[1]
        rival = SimServer([stranger], f"udpout:127.0.0.1:{port}", speedup=50.0)
        starter = threading.Thread(target=lambda: begun.wait(10.0) and rival.start(), daemon=True)
        starter.start()
        with SimServer([board], f"udpout:127.0.0.1:{port}", speedup=10.0):
            try:
                result = upload_mission(link, mission(count=400), options=OPTIONS)
            finally:
                begun.set()
                starter.join(5.0)
                rival.stop()
    assert stranger.got == []
    assert result.verified
    assert result.changed == "ambiguous"
    assert isinstance(result.error(), VehicleRefused)
    assert board.items()[5:] != ()


def on_air(*crafts: tuple[str, Craft], air: Air) -> Link:
    for address, craft in crafts:
        air.put(address, craft)
    return air.link()


def craft(air: Air, home: Home = HOME, signing: Signing | None = None, **more: Any) -> Craft:
    one = LoopbackVehicle(1, COPTER, lat_deg=home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7, amsl_m=371.0, **more)
    return Craft(one, air, signing)


SLOW = SessionOptions(unchecked=True, read_parameters=False)


def test_two_behind_one_address_are_told_by_their_boot_clocks() -> None:
    air = Air(1, Radio(), limit_s=300.0)
    first, second = craft(air), craft(air)
    second.hub.on_timer(air.now - 500.0)  # it has been on for longer
    with on_air(("router", first), ("router", second), air=air) as link:
        reason = outcome_of(link)
    assert reason == "ambiguous"


def outcome_of(link: Link) -> str:
    """The reason why an upload over ``link`` is refused."""
    try:
        return str(upload_mission(link, mission(), options=SLOW).changed)
    except VehicleRefused as error:
        return error.reason


def test_a_twin_that_comes_in_the_middle_behind_the_same_address_ends_the_transfer() -> None:
    air = Air(2, Radio(delay_s=0.3), limit_s=600.0)
    first, second = craft(air), craft(air, FAR)
    air.later(9.0, lambda: air.put("router", second))
    with on_air(("router", first), air=air) as link:
        result = upload_mission(link, mission(count=60), options=SLOW)
    assert not result.verified
    assert result.changed in ("moved", "ambiguous")
    assert result.error().exit_code == 5  # type: ignore[union-attr]
    assert air.now < 1000.0 + 15.0


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("comes_s", [4.0, 4.2, 4.4, 4.6, 4.8])
def test_the_first_request_beside_a_twin_shows_that_they_are_two_and_is_not_answered(
    comes_s: float, signed: bool
) -> None:
    """The twin is another component of the same number behind the same address; ours asks on, and says nothing else."""
    air = Air(1, Radio(delay_s=0.3, jitter_s=0.0), limit_s=600.0)
    signing = (lambda: Signing(SigningKey(bytes(32)), clock=air.wall_clock)) if signed else lambda: None
    first, second = craft(air, signing=signing()), craft(air, FAR, signing=signing(), compid=2)
    heard: list[tuple[object, str]] = []
    late: list[bytes] = []
    air.heard = lambda by, peer, message: heard.append((by, message.get_type()))

    def written(peer: Any, data: bytes) -> None:
        if (second, "HEARTBEAT") in heard and data[7] in (COUNT, ITEM, CLEAR):
            late.append(data)

    air.written = written
    air.later(comes_s, lambda: air.put("router", second))
    air.put("router", first)
    with air.link(signing()) as link:
        result = upload_mission(link, mission(count=60), options=SLOW)
    assert (second, "HEARTBEAT") in heard
    assert result.changed == "ambiguous"
    assert late == []


def test_a_request_beside_a_twin_gets_no_prompt_answer() -> None:
    """Over a real socket: ten requests are answered on the spot, and the first one behind a twin's heartbeat is not."""
    answers: list[str] = []

    def script(board: Asker) -> None:
        board.hear("HEARTBEAT")
        pilot = dialect.MAVLink_heartbeat_message(2, 3, 0, 0, dialect.MAV_STATE_STANDBY, 3)
        board.say(pilot)
        board.say(dialect.MAVLink_global_position_int_message(1, HOME.lat_e7, HOME.lon_e7, 371_000, 0, 0, 0, 0, 0))
        board.say(dialect.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, 0))
        board.hear("MISSION_COUNT")
        for seq in range(10):
            board.ask(seq)
        board.socket.sendto(FrameWriter(Address(1, 2)).pack(pilot), board.station)
        board.say(wire.encode(Request(10), GCS))
        board.socket.settimeout(0.5)
        with contextlib.suppress(TimeoutError):
            while True:
                data, _ = board.socket.recvfrom(4096)
                answers.extend(m.get_type() for m in board.parser.feed(data, datagram=True))

    with asker(script) as board, Link(board.url) as link:
        result = upload_mission(link, mission(count=40), options=OPTIONS)
    assert result.changed == "ambiguous"
    assert "MISSION_ITEM_INT" not in answers


def test_a_place_that_is_told_late_is_held_to_from_then_on() -> None:
    """No position came while the vehicle was looked at: every look behind the first one asks for it all the same."""
    air = Air(1, Radio(), limit_s=60.0)
    beat = dialect.MAVLink_heartbeat_message(2, 3, 0, 0, dialect.MAV_STATE_STANDBY, 3)

    def note(message: Any) -> None:
        recheck.note(Heard(Address(1, 1), "a", message), air.now)

    def place(home: Home) -> Any:
        return dialect.MAVLink_global_position_int_message(0, home.lat_e7, home.lon_e7, 371_000, 0, 0, 0, 0, 0)

    with air.link() as link:
        watch = Watch(1)
        watch.note(Heard(Address(1, 1), "a", beat), air.now)
        state = watch.state(air.now)
        assert state is not None
        recheck = Recheck(link.channel(1), watch, state, lambda _: ([], []))
        assert recheck.gate(air.now) is None  # it reports none
        note(place(HOME))
        assert recheck.gate(air.now) is None
        for _ in range(4):
            air.now += 1.0
            note(beat)
        assert isinstance(recheck.gate(air.now), Wait)
        note(place(FAR))
        stopped = recheck.gate(air.now)
    assert isinstance(stopped, Changed)
    assert stopped.reason == "moved"


def test_who_speaks_after_a_silence_is_looked_at_before_it_is_answered() -> None:
    """Another vehicle at the same address, which asks for items at once."""
    air = Air(3, Radio(), limit_s=600.0)
    first, second = craft(air), craft(air, FAR)
    asked = FrameWriter(Address(1, 1))
    sent: list[bytes] = []

    def swap() -> None:
        air.at("a").clear()

        def ask() -> None:
            sent.clear()
            air.written = lambda peer, data: sent.append(data)
            air.say("a", asked.pack(wire.encode(Request(3), Address(255, 190))), second)

        air.later(5.0, ask)
        air.later(5.5, lambda: air.put("a", second))

    air.later(2.2, swap)
    with on_air(("a", first), air=air) as link:
        result = upload_mission(link, mission(count=400), options=SLOW)
    assert result.changed == "moved"
    assert not [data for data in sent if data[7] in (44, 73, 45)]


@pytest.mark.slow
def test_a_silent_vehicle_and_a_voice_from_elsewhere_are_not_taken_for_one() -> None:
    air = Air(4, Radio(delay_s=0.05), limit_s=600.0)
    first, second = craft(air), craft(air)
    air.later(4.0, lambda: (air.at("a").clear(), air.put("b", second)))
    with on_air(("a", first), air=air) as link:
        result = upload_mission(link, mission(count=300), options=SLOW)
    assert not result.verified
    assert isinstance(result.error(), (LinkError, VehicleRefused))
    assert not second.vehicle.items()


def test_reading_and_comparing_refuse_two_with_one_number() -> None:
    air = Air(5, Radio(), limit_s=100.0)
    first, second = craft(air), craft(air)
    first.vehicle.load(mission().wire_items())
    with on_air(("a", first), ("b", second), air=air) as link:
        for act in (
            lambda: verify_mission(link, mission(), options=SLOW),
            lambda: download_items(link, 1, options=SLOW),
            lambda: clear_mission(link, 1, options=SLOW),
        ):
            with pytest.raises(VehicleRefused, match="2 autopilots"):
                act()
    assert first.vehicle.items()


# -- one vehicle's trouble is its own -----------------------------------------------------------------------------


def fleet(*boards: LoopbackVehicle, judge: Callable[[Mission], str | None] | None = None, **options: Any) -> list[Any]:
    with SimServer(boards, "udpin:127.0.0.1:0", speedup=10.0) as server:
        for n, (_, telemetry, _) in enumerate(server.hub.vehicles):
            if n == 0:
                telemetry.parameters = OddParameters(boards[0].autopilot, 1, random.Random(1))
        with Link(server.url_for_gcs) as link:
            orders = [
                UploadOrder(
                    link, mission(sysid=b.sysid), options=replace(OPTIONS, **options), judge=judge if n == 0 else None
                )
                for n, b in enumerate(boards)
            ]
            return upload_fleet(orders)


def test_parameters_that_are_no_numbers_are_said_and_end_nothing() -> None:
    results = fleet(vehicle(), vehicle(sysid=2), read_parameters=True)
    assert [getattr(r, "verified", r) for r in results] == [True, True]
    assert "parameter_is_no_number" in [w.code for w in results[0].warnings]
    assert "parameter_is_no_number" not in [w.code for w in results[1].warnings]


@pytest.mark.slow
def test_a_bug_in_one_vehicles_job_leaves_the_others_standing() -> None:
    def broken(_: Mission, __: object) -> Note | None:
        raise ZeroDivisionError("a bug")

    first, second = fleet(vehicle(), vehicle(sysid=2), judge=broken)
    assert isinstance(first, GcsplanError)
    assert first.exit_code == 70
    assert "ZeroDivisionError" in first.message
    assert second.verified


# -- patience -----------------------------------------------------------------------------------------------------


def on_patient_air(board: LoopbackVehicle, timeout_s: float, count: int = 8) -> tuple[Any, float]:
    air = Air(6, Radio(), limit_s=2000.0)
    with on_air(("a", Craft(board, air)), air=air) as link:
        try:
            return upload_mission(
                link, mission(count=count), options=replace(SLOW, timeout_s=timeout_s)
            ), air.now - 1000.0
        except GcsplanError as error:
            return error, air.now - 1000.0


class Miser(Acting):
    """Answers no request for an item; ``counts`` is what it announces."""

    def __init__(self, counts: int | None = None) -> None:
        super().__init__(COPTER, lambda *_: None)
        self.counts = counts

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        if isinstance(packet.message, Request):
            self.got.append(packet.message)
            return []
        if isinstance(packet.message, RequestList) and self.counts is not None:
            return [Packet(self.address, packet.source, Count(self.counts))]
        return super().receive(packet, now)


@pytest.mark.parametrize("timeout_s", [10.0, 60.0])
def test_a_vehicle_that_sends_no_items_is_left_after_the_users_patience(timeout_s: float) -> None:
    result, took_s = on_patient_air(Miser(), timeout_s)
    assert (result.outcome, result.verified) == ("unknown", False)
    assert took_s <= timeout_s + 15.0


def test_more_than_a_vehicle_can_hold_is_not_even_begun() -> None:
    board = Miser(65535)
    result, took_s = on_patient_air(board, 60.0)
    assert not result.verified
    assert board.count(Request) == 0
    assert took_s < 20.0
    air = Air(7, Radio(), limit_s=100.0)
    with on_air(("a", Craft(board, air)), air=air) as link, pytest.raises(VehicleRefused, match="at most 4369"):
        download_items(link, 1, options=SLOW)
    assert board.count(Request) == 0


@pytest.mark.slow
def test_a_vehicle_that_asks_on_and_on_is_left_after_two_seconds_an_item_more() -> None:
    """Every request is new to it, and slow: progress, but without an end in sight."""

    class Slow(Acting):
        def receive(self, packet: Packet, now: float) -> list[Packet]:
            answers = super().receive(packet, now)
            return [] if isinstance(packet.message, Item) else answers  # it asks again after a second, by timer

    result, took_s = on_patient_air(Slow(COPTER, lambda *_: None), 5.0, 40)
    assert took_s <= 5.0 + 2.0 * 41 + 15.0
    assert not result.verified or took_s < 100.0


def test_a_timeout_that_is_none_is_refused() -> None:
    with pytest.raises(GcsplanError, match="timeout"):
        uploaded(vehicle(), timeout_s=0.0)


def test_a_vehicle_that_boots_beyond_the_timeout_is_left_at_once_and_unwritten() -> None:
    """The time until it was ready is none of the transfer's."""
    board = Acting(COPTER, lambda *_: None, boot_s=4.5, seed=1)
    result, _ = on_patient_air(board, 5.0, 2)
    assert result.verified
    assert board.count(Count) == 1
