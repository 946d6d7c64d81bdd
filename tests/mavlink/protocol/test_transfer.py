"""The mission protocol's machines, message by message and in simulated weather."""

from __future__ import annotations

import random
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mavlink.mission.mission import ALL, FENCE, MISSION, RALLY, MissionItem
from gcsplan.mavlink.protocol.download import Download
from gcsplan.mavlink.protocol.machine import ImpossibleTransition, Machine, Timers
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.mavlink.protocol.outcome import CANCELLED, DENIED, ERROR, INVALID_SEQUENCE, NO_SPACE, code_cure, code_words
from gcsplan.mavlink.protocol.transfer import Accepted, Refused, Settled, Unknown, VerifiedUpload
from gcsplan.mavlink.protocol.upload import Clear, Upload
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws, seeds
from tests.support.lossy import Weather, run

US, V = Address(255, 190), Address(1, 1)
COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4


def waypoint(n: int) -> MissionItem:
    return MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000 + 1000 * n, -843_800_000 + 777 * n, 60.005 + n)


def waypoints(count: int) -> tuple[MissionItem, ...]:
    return tuple(waypoint(n) for n in range(count))


def says(
    machine: Machine, message: MissionMessage, now: float = 0.0, *, source: Address = V, target: Address = US
) -> list[MissionMessage]:
    """What ``machine`` answers when the vehicle says ``message``."""
    answers = machine.receive(Packet(source, target, message), now)
    assert all(p.source == US and p.target == V for p in answers)
    return [p.message for p in answers]


def started_upload(count: int = 3, timers: Timers | None = None) -> Upload:
    upload = Upload(waypoints(count), us=US, vehicle=V, timers=timers)
    assert [p.message for p in upload.start(0.0)] == [Count(count)]
    return upload


def upload_asked_for(seqs: list[int], count: int = 3) -> Upload:
    upload = started_upload(count)
    for seq in seqs:
        says(upload, Request(seq))
    return upload


def wait_out(machine: Machine, limit: int = 200) -> float:
    """Let every deadline pass in silence; return when the last one was."""
    at = 0.0
    for _ in range(limit):
        if machine.deadline is None:
            return at
        at = machine.deadline
        machine.on_timer(at)
    raise AssertionError("it never ends")


# -- upload -------------------------------------------------------------------------------------------------------


def test_an_upload_in_order_is_accepted() -> None:
    upload = started_upload(3)
    for seq in range(3):
        assert says(upload, Request(seq)) == [Item(seq, waypoint(seq), current=int(seq == 0))]
        assert upload.progress.done == seq + 1
    assert says(upload, Ack(0, opaque_id=77)) == []
    assert upload.outcome == Accepted(77)
    assert upload.deadline is None


@given(st.lists(st.integers(0, 6), max_size=60))
def test_any_request_in_range_is_answered_in_any_order_again_and_again(seqs: list[int]) -> None:
    upload = started_upload(5)
    for seq in seqs:
        answer = says(upload, Request(seq))
        assert answer == ([Item(seq, waypoint(seq), current=int(seq == 0))] if seq < 5 else [])
    assert upload.outcome is None
    assert upload.progress.done == len({s for s in seqs if s < 5})


def test_a_legacy_request_is_answered_with_an_int_item() -> None:
    (answer,) = says(started_upload(), Request(1, legacy=True))
    assert type(answer) is Item


def test_the_count_is_repeated_only_while_nothing_was_asked() -> None:
    upload = started_upload()
    assert upload.on_timer(1.0) == []
    assert [p.message for p in upload.on_timer(1.5)] == [Count(3)]
    says(upload, Request(0), 1.6)
    assert upload.on_timer(3.2) == []
    assert upload.deadline == pytest.approx(11.6)
    assert upload.on_timer(11.6) == []
    assert isinstance(upload.outcome, Unknown)
    assert "1 of 3" in upload.outcome.why


def test_silence_from_the_start_ends_unknown_after_all_retries() -> None:
    upload = started_upload()
    assert wait_out(upload) == pytest.approx(9.0)
    assert isinstance(upload.outcome, Unknown)
    assert upload.outcome.silent
    assert upload.retries == 5


def test_no_item_is_ever_sent_on_a_timer() -> None:
    upload = upload_asked_for([0, 1])
    while upload.deadline is not None:
        assert all(not isinstance(p.message, Item) for p in upload.on_timer(upload.deadline))


def test_silence_after_the_last_item_is_unknown() -> None:
    upload = upload_asked_for([0, 1, 2])
    assert wait_out(upload) == pytest.approx(3.0)
    assert isinstance(upload.outcome, Unknown)


def test_an_error_after_the_last_item_is_unknown() -> None:
    upload = upload_asked_for([0, 1, 2])
    says(upload, Ack(ERROR))
    wait_out(upload)
    assert isinstance(upload.outcome, Unknown)
    assert "error" in upload.outcome.why


def test_invalid_sequence_is_not_the_end() -> None:
    upload = upload_asked_for([0, 1])
    says(upload, Ack(INVALID_SEQUENCE))
    says(upload, Request(2))
    says(upload, Ack(INVALID_SEQUENCE))
    says(upload, Ack(0))
    assert upload.outcome == Accepted()


def test_invalid_sequence_and_then_silence_is_unknown_and_no_refusal() -> None:
    upload = upload_asked_for([0, 1])
    says(upload, Ack(INVALID_SEQUENCE))
    assert wait_out(upload) > 0.0
    assert isinstance(upload.outcome, Unknown)


def test_an_error_in_the_middle_is_not_the_end_if_the_vehicle_goes_on() -> None:
    # PX4 says so of a COUNT that the network has doubled.
    upload = upload_asked_for([0])
    says(upload, Ack(ERROR), 0.1)
    says(upload, Request(1), 0.2)
    says(upload, Request(2), 0.3)
    says(upload, Ack(0), 0.4)
    assert upload.outcome == Accepted()


def test_a_refusal_names_the_item_once_the_vehicle_stops_asking() -> None:
    upload = upload_asked_for([0, 1])
    says(upload, Ack(9))
    assert upload.outcome is None
    wait_out(upload)
    assert upload.outcome == Refused(9, 1)
    assert "item 1" in str(upload.outcome)
    assert "param4" in str(upload.outcome)


@pytest.mark.parametrize(("code", "word"), [(NO_SPACE, "booting"), (DENIED, "another ground station")])
def test_a_refused_count_blames_no_item_and_is_told_in_words(code: int, word: str) -> None:
    upload = started_upload()
    says(upload, Ack(code))
    wait_out(upload)
    assert upload.outcome == Refused(code, None)
    assert word in str(upload.outcome)
    assert upload.retries == 0


def test_an_ack_that_arrives_too_early_does_not_count_as_accepted() -> None:
    upload = upload_asked_for([0, 1])
    says(upload, Ack(0))
    assert upload.outcome is None
    wait_out(upload)
    assert isinstance(upload.outcome, Unknown)
    assert "2 of 3" in upload.outcome.why


def test_a_stale_ack_before_the_first_request_changes_nothing() -> None:
    upload = started_upload()
    says(upload, Ack(0), 0.1)
    says(upload, Ack(CANCELLED), 0.2)
    assert [p.message for p in upload.on_timer(2.0)] == [Count(3)]
    for seq in range(3):
        says(upload, Request(seq), 2.1)
    says(upload, Ack(0), 2.2)
    assert upload.outcome == Accepted()


def test_after_the_end_requests_are_still_answered() -> None:
    upload = upload_asked_for([0, 1, 2])
    says(upload, Ack(0))
    assert says(upload, Request(2)) == [Item(2, waypoint(2))]
    assert upload.outcome == Accepted()
    assert upload.deadline is None


def test_a_vehicle_that_asks_for_the_same_item_for_ever_does_not_hang_an_upload() -> None:
    upload, now = started_upload(), 0.0
    while upload.outcome is None and now < 1000:
        says(upload, Request(1), now)
        now += 0.5
        upload.on_timer(now)
    assert isinstance(upload.outcome, Unknown)
    assert "no further" in upload.outcome.why


def test_a_vehicle_that_starts_over_for_ever_does_not_hang_an_upload() -> None:
    upload, now = started_upload(), 0.0
    while upload.outcome is None and now < 1000:
        says(upload, Request(int(now) % 2), now)
        now += 1.0
        upload.on_timer(now)
    assert isinstance(upload.outcome, Unknown)
    assert now < 1000


@pytest.mark.parametrize(
    "packet",
    [
        Packet(Address(2, 1), US, Ack(0)),  # another vehicle
        Packet(Address(1, 2), US, Ack(0)),  # another component
        Packet(V, Address(254, 190), Ack(0)),  # to another ground station
        Packet(V, Address(255, 1), Ack(0)),  # to another component of ours
        Packet(V, US, Ack(0, FENCE)),  # about another list
        Packet(V, US, Count(3)),  # not for this role
        Packet(V, US, RequestList()),
    ],
)
def test_what_does_not_concern_us_is_passed_over(packet: Packet) -> None:
    upload = upload_asked_for([0, 1, 2])
    before = upload.deadline
    assert upload.receive(packet, 1.0) == []
    assert (upload.outcome, upload.deadline) == (None, before)


def test_a_broadcast_is_for_us_too() -> None:
    upload = upload_asked_for([0, 1, 2])
    says(upload, Ack(0), target=Address(0, 0))
    assert upload.outcome == Accepted()


def test_a_cancelled_upload_tells_the_vehicle_and_answers_no_more() -> None:
    upload = upload_asked_for([0])
    assert [p.message for p in upload.cancel(1.0)] == [Ack(CANCELLED)]
    assert isinstance(upload.outcome, Unknown)
    assert says(upload, Request(1)) == []


def test_a_second_start_is_named_as_impossible() -> None:
    upload = started_upload()
    with pytest.raises(ImpossibleTransition, match="upload: START is impossible in state ANNOUNCED"):
        upload.start(1.0)


def test_an_empty_list_is_not_uploaded() -> None:
    with pytest.raises(InputError, match="clear"):
        Upload((), us=US, vehicle=V)


def test_a_mission_type_that_is_no_list_is_refused() -> None:
    with pytest.raises(InputError, match="mission type"):
        Upload(waypoints(1), us=US, vehicle=V, mission_type=7)
    with pytest.raises(InputError, match="mission type"):
        Download(us=US, vehicle=V, mission_type=ALL)


def test_a_fence_goes_out_as_a_fence() -> None:
    upload = Upload(waypoints(1), us=US, vehicle=V, mission_type=FENCE)
    assert [p.message for p in upload.start(0.0)] == [Count(1, FENCE)]
    assert says(upload, Request(0)) == []
    assert says(upload, Request(0, FENCE)) == [Item(0, waypoint(0), FENCE, current=0)]


def test_timers_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="response_s"):
        Timers(response_s=0.0)
    with pytest.raises(InputError, match="retries"):
        Timers(retries=-1)


@pytest.mark.parametrize("code", range(1, 16))
def test_every_code_has_words_and_a_cure(code: int) -> None:
    assert len(code_words(code)) > 5
    assert len(code_cure(code)) > 5
    assert f"MAV_MISSION_RESULT {code}" in str(Refused(code, 4))


def test_a_code_that_nobody_defined_is_told_as_such() -> None:
    assert "99" in code_words(99)


# -- clear --------------------------------------------------------------------------------------------------------


def test_clearing_is_asked_for_until_it_is_acknowledged() -> None:
    clear = Clear(us=US, vehicle=V, mission_type=RALLY)
    assert [p.message for p in clear.start(0.0)] == [ClearAll(RALLY)]
    assert [p.message for p in clear.on_timer(1.5)] == [ClearAll(RALLY)]
    says(clear, Ack(0, RALLY), 1.6)
    assert clear.outcome == Accepted()


def test_clearing_a_mission_that_is_flown_is_refused_in_words() -> None:
    clear = Clear(us=US, vehicle=V)
    clear.start(0.0)
    says(clear, Ack(ERROR))
    assert isinstance(clear.outcome, Refused)
    assert "flown" in str(clear.outcome)


def test_clearing_in_silence_is_unknown() -> None:
    clear = Clear(us=US, vehicle=V)
    clear.start(0.0)
    wait_out(clear)
    assert isinstance(clear.outcome, Unknown)
    assert clear.outcome.silent


# -- download -----------------------------------------------------------------------------------------------------


def started_download(count: int = 3, opaque_id: int = 5) -> Download:
    download = Download(us=US, vehicle=V)
    assert [p.message for p in download.start(0.0)] == [RequestList()]
    assert says(download, Count(count, opaque_id=opaque_id), 0.1) == [Request(0)]
    return download


def test_a_download_asks_in_order_and_acknowledges_at_the_end() -> None:
    download = started_download()
    assert says(download, Item(0, waypoint(0)), 0.2) == [Request(1)]
    assert says(download, Item(1, waypoint(1)), 0.3) == [Request(2)]
    assert says(download, Item(2, waypoint(2)), 0.4) == [Ack(0)]
    assert download.outcome == Accepted(5)
    assert download.items == waypoints(3)
    assert download.opaque_id == 5


def test_duplicated_and_early_items_are_passed_over() -> None:
    download = started_download()
    assert says(download, Item(2, waypoint(2)), 0.2) == []
    assert says(download, Item(0, waypoint(0)), 0.3) == [Request(1)]
    assert says(download, Item(0, waypoint(7)), 0.4) == []
    assert says(download, Item(1, waypoint(1)), 0.5) == [Request(2)]
    assert says(download, Item(2, waypoint(2)), 0.6) == [Ack(0)]
    assert download.items == waypoints(3)


def test_an_item_is_asked_for_again_after_a_quarter_of_a_second() -> None:
    download = started_download()
    assert download.deadline == pytest.approx(0.35)
    assert [p.message for p in download.on_timer(0.35)] == [Request(0)]


def test_on_a_slow_link_the_timer_follows_the_round_trip() -> None:
    download = Download(us=US, vehicle=V)
    download.start(0.0)
    says(download, Count(3), 1.0)
    assert download.deadline == pytest.approx(2.5)


def test_the_next_item_waits_for_a_repeated_question_that_is_still_on_its_way() -> None:
    download = Download(us=US, vehicle=V)
    download.start(0.0)
    says(download, Count(3), 0.2)
    download.on_timer(0.5)  # item 0 again
    assert says(download, Item(0, waypoint(0)), 0.55) == []  # sooner than any answer: it belongs to the first question
    assert [p.message for p in download.on_timer(download.deadline or 0.0)] == [Request(1)]


def test_the_last_item_again_is_acknowledged_again() -> None:
    download = started_download(1)
    says(download, Item(0, waypoint(0)), 0.2)
    assert says(download, Item(0, waypoint(0)), 0.3) == [Ack(0)]
    assert download.outcome == Accepted(5)


def test_an_empty_list_is_a_whole_one() -> None:
    download = Download(us=US, vehicle=V)
    download.start(0.0)
    assert says(download, Count(0)) == [Ack(0)]
    assert (download.outcome, download.items) == (Accepted(), ())


def test_a_count_that_changes_in_the_middle_starts_anew() -> None:
    download = started_download(3)
    says(download, Item(0, waypoint(0)), 0.2)
    says(download, Count(2), 0.3)
    assert [p.message for p in download.on_timer(download.deadline or 0.0)] == [RequestList()]
    says(download, Count(2), 2.0)
    for n in range(2):
        says(download, Item(n, waypoint(n + 10)), 2.1)
    assert download.items == (waypoint(10), waypoint(11))


def test_the_same_count_again_changes_nothing() -> None:
    download = started_download(3)
    says(download, Item(0, waypoint(0)), 0.2)
    assert says(download, Count(3, opaque_id=5), 0.3) == []
    assert download.progress.done == 1


def test_a_busy_vehicle_is_asked_again_and_not_for_ever() -> None:
    download, now = Download(us=US, vehicle=V), 0.0
    download.start(now)
    while download.outcome is None and now < 1000:
        says(download, Ack(DENIED), now)
        now = download.deadline or now
        download.on_timer(now)
    assert isinstance(download.outcome, Unknown)
    assert "another ground station" in download.outcome.why
    assert now > 10  # ArduPilot denies for 8 s after a broken upload


def test_a_list_of_another_kind_is_refused_at_once() -> None:
    download = Download(us=US, vehicle=V)
    download.start(0.0)
    says(download, Ack(3))
    assert download.outcome == Refused(3)


def test_items_in_the_old_float_form_are_refused_in_words() -> None:
    download = started_download()
    says(download, LegacyItem(0, waypoint(0)), 0.2)
    assert isinstance(download.outcome, Refused)
    assert "float32" in str(download.outcome)


def test_silence_in_the_middle_begins_anew_and_ends_unknown() -> None:
    download = started_download()
    says(download, Item(0, waypoint(0)), 0.2)
    assert wait_out(download) < 60
    assert isinstance(download.outcome, Unknown)


def test_a_cancelled_download_tells_the_vehicle() -> None:
    download = started_download()
    assert [p.message for p in download.cancel(0.2)] == [Ack(CANCELLED)]
    assert says(download, Item(0, waypoint(0)), 0.3) == []


MESSAGES = st.one_of(
    st.builds(Count, st.integers(0, 4), st.sampled_from([MISSION, FENCE]), st.integers(0, 2)),
    st.builds(Request, st.integers(0, 5), legacy=st.booleans()),
    st.builds(lambda seq: Item(seq, waypoint(seq)), st.integers(0, 5)),
    st.builds(lambda seq: LegacyItem(seq, waypoint(seq)), st.integers(0, 5)),
    st.builds(Ack, st.integers(0, 20)),
    st.just(RequestList()),
    st.just(ClearAll()),
)


@settings(max_examples=draws(150))
@given(st.integers(0, 3), st.lists(st.tuples(MESSAGES, st.floats(0, 5), st.booleans()), max_size=60))
def test_nothing_that_a_vehicle_says_breaks_a_machine_or_keeps_it_from_ending(
    which: int, script: list[tuple[MissionMessage, float, bool]]
) -> None:
    make = [
        lambda: Upload(waypoints(4), us=US, vehicle=V),
        lambda: Download(us=US, vehicle=V),
        lambda: Clear(us=US, vehicle=V),
        lambda: VerifiedUpload(waypoints(4), COPTER, us=US, vehicle=V),
    ]
    machine = make[which]()
    now = 0.0
    machine.start(now)
    for message, later, timer in script:
        now += later
        machine.receive(Packet(V, US, message), now)
        if timer:
            machine.on_timer(now)
    for _ in range(2000):
        if machine.deadline is None:
            break
        machine.on_timer(machine.deadline)
    ended = machine.result if isinstance(machine, VerifiedUpload) else machine.outcome
    assert ended is not None


# -- verified upload against loopback vehicles --------------------------------------------------------------------


def vehicle(autopilot: Autopilot, **trouble: object) -> LoopbackVehicle:
    return LoopbackVehicle(
        1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0, misbehave=Misbehaviour(**trouble)  # type: ignore[arg-type]
    )  # fmt: skip


def fly(
    board: LoopbackVehicle, count: int = 12, weather: Weather | None = None, seed: int = 0, **more: object
) -> tuple[Settled, float]:
    """Upload ``count`` items to ``board`` in ``weather``; how it ended, and the simulated seconds."""
    items = waypoints(count)
    machine = VerifiedUpload(items, board.autopilot, us=US, vehicle=V, **more)  # type: ignore[arg-type]
    seconds = run(machine, board, weather or Weather(), seed, lambda: machine.result is not None)
    assert machine.result is not None
    return machine.result, seconds


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_on_a_good_link_a_mission_is_verified_at_once(autopilot: Autopilot) -> None:
    settled, seconds = fly(vehicle(autopilot))
    assert settled.verified
    assert settled.attempts == 1
    assert settled.retries == 0
    assert seconds < 3


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_corrupted_item_on_board_is_caught_and_named(autopilot: Autopilot) -> None:
    settled, _ = fly(vehicle(autopilot, corrupt=5))
    assert not settled.verified
    assert [d.seq for d in settled.differences if not d.excused] == [5]
    assert "altitude" in str(settled.differences[-1])
    assert settled.on_board


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_an_edit_by_a_second_ground_station_is_caught_and_named(autopilot: Autopilot) -> None:
    settled, _ = fly(vehicle(autopilot, edit=3))
    assert not settled.verified
    assert isinstance(settled.outcome, Accepted)
    assert [d.seq for d in settled.differences if not d.excused] == [3]


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
@pytest.mark.parametrize("loses", [False, True])
def test_a_reboot_in_the_middle_ends_in_a_whole_mission_or_is_told(autopilot: Autopilot, loses: bool) -> None:
    board = vehicle(autopilot, reboot_at=6, reboot_loses=loses)
    settled, _ = fly(board)
    assert settled.verified
    assert settled.attempts > 1
    once, _ = fly(vehicle(autopilot, reboot_at=6, reboot_loses=loses), attempts=1)
    assert not once.verified
    assert isinstance(once.outcome, Unknown)
    assert once.on_board


def test_a_half_replaced_mission_is_named() -> None:
    board = vehicle(COPTER, reboot_at=6)
    board.load(tuple(waypoint(n + 50) for n in range(12)))
    settled, _ = fly(board, attempts=1)
    assert "do not fly" in settled.on_board
    assert "12 items" in settled.on_board


def test_a_refused_item_is_named_together_with_what_is_left_on_board() -> None:
    settled, _ = fly(vehicle(COPTER, refuse=4, refuse_code=8))
    assert settled.outcome == Refused(8, 4)
    assert "do not fly" in settled.on_board
    atomic, _ = fly(vehicle(PX4, refuse=4, refuse_code=8))
    assert atomic.outcome == Refused(8, 4)
    assert "no mission" in atomic.on_board


def test_the_same_unexplained_error_at_the_same_item_is_tried_only_twice() -> None:
    settled, _ = fly(vehicle(COPTER, refuse=4, refuse_code=ERROR))
    assert settled.outcome == Refused(ERROR, 4)
    assert settled.attempts == 2


def test_a_vehicle_without_room_refuses_before_anything_is_lost() -> None:
    board = vehicle(COPTER, no_space=True)
    board.load(waypoints(4))
    settled, _ = fly(board)
    assert settled.outcome == Refused(NO_SPACE, None)
    assert "untouched" in settled.on_board
    assert len(board.items()) == 4


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_foreign_system_that_lies_is_passed_over(autopilot: Autopilot) -> None:
    board = vehicle(autopilot, stray_sysid=2)
    settled, _ = fly(board)
    assert settled.verified
    assert settled.read_back == board.items()


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_answers_under_a_foreign_system_id_never_count(autopilot: Autopilot) -> None:
    settled, _ = fly(vehicle(autopilot, answer_sysid=2))
    assert not settled.verified
    assert isinstance(settled.outcome, Unknown)


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_answers_about_a_stale_mission_type_are_passed_over(autopilot: Autopilot) -> None:
    board = vehicle(autopilot, stale_type=RALLY)
    settled, _ = fly(board)
    assert settled.verified
    assert settled.read_back == board.items()


@pytest.mark.parametrize("after", [0, 1, 5, 12, 14, 20])
def test_a_link_that_dies_ends_unknown_and_says_so(after: int) -> None:
    settled, seconds = fly(vehicle(COPTER, silent_after=after))
    assert not settled.verified
    assert isinstance(settled.outcome, Unknown)
    assert settled.on_board
    assert seconds < 120


def test_a_lost_final_ack_is_settled_by_reading_back() -> None:
    class Deaf(LoopbackVehicle):
        def receive(self, packet: Packet, now: float) -> list[Packet]:
            answers = super().receive(packet, now)
            return [p for p in answers if not (isinstance(p.message, Ack) and isinstance(packet.message, Item))]

    board = Deaf(1, COPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0)
    settled, _ = fly(board)
    assert settled.verified
    assert settled.attempts == 1


def test_a_cancelled_verified_upload_is_unknown() -> None:
    machine = VerifiedUpload(waypoints(3), COPTER, us=US, vehicle=V)
    machine.start(0.0)
    assert [p.message for p in machine.cancel(1.0)] == [Ack(CANCELLED)]
    assert machine.result is not None
    assert isinstance(machine.result.outcome, Unknown)
    assert machine.cancel(2.0) == []


# -- weather ------------------------------------------------------------------------------------------------------

SEEDS = 2000
CHUNKS = 4


def weather_of(seed: int) -> Weather:
    """Loss 0 … 40 %, and anything else that weather can be."""
    rng = random.Random(seed)
    return Weather(
        loss=rng.choice([0.0, 0.05, 0.1, 0.2, 0.3, 0.4]),
        duplicate=rng.choice([0.0, 0.05, 0.1]),
        held_up=rng.choice([0.0, 0.05, 0.1]),
        delay_s=rng.choice([0.002, 0.02, 0.1]),
        jitter_s=rng.choice([0.002, 0.02, 0.1]),
    )


def trouble_of(seed: int) -> dict[str, object]:
    """In every fourth flight something goes wrong on board as well."""
    rng = random.Random(-seed)
    if seed % 4:
        return {}
    return rng.choice([
        {"corrupt": rng.randrange(1, 6), "corrupt_field": rng.choice(["x", "y", "z"])},
        {"edit": rng.randrange(1, 6)},
        {"reboot_at": rng.randrange(1, 8), "reboot_loses": rng.random() < 0.5},
        {"silent_after": rng.randrange(20)},
        {"stray_sysid": 2},
        {"stale_type": FENCE},
    ])  # fmt: skip


@pytest.mark.nightly_but("arducopter-0", "px4-1")
@pytest.mark.slow
@pytest.mark.parametrize("chunk", seeds(2, 2, CHUNKS))
@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_in_any_weather_nothing_is_falsely_verified_and_nothing_hangs(autopilot: Autopilot, chunk: int) -> None:
    ended: Counter[bool] = Counter()
    for seed in range(chunk, SEEDS, CHUNKS):
        weather, trouble = weather_of(seed), trouble_of(seed)
        board = vehicle(autopilot, **trouble)
        settled, _ = fly(board, 6, weather, seed)  # raises Hang
        if settled.verified:
            expected = vehicle(autopilot)
            fly(expected, 6)
            same = board.items()[1:] == expected.items()[1:] and len(board.items()) == 6
            assert same, f"falsely verified: seed {seed}, {weather}, {trouble}"
        if weather.loss <= 0.2 and not trouble:
            ended[settled.verified] += 1
    assert ended[True] >= 0.99 * (ended[True] + ended[False]), f"{ended} at up to 20 % loss"


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_long_mission_gets_through_ten_percent_loss(autopilot: Autopilot) -> None:
    board = vehicle(autopilot)
    settled, _ = fly(board, 600, Weather(loss=0.1), 1)
    assert settled.verified
    assert settled.retries > 0
    assert settled.read_back == board.items()
    assert len(board.items()) == 600
