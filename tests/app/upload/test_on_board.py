"""Why a mission is not sent, or not verified, with what is on board: as codes for programs, as sentences for people."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.upload.job import UploadJob
from gcsplan.app.upload.on_board import judge_on_board, settings_of
from gcsplan.app.upload.run import jobs_of
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.notes.note import Note
from tests.support.forecasts import mission_in_forecast

OFF = Note("parameter_not_assumed", name="LAND_SPEED", value=30.0, assumed="50", wanted=50.0,
           why=Note("assumed_last_ten_metres"))  # fmt: skip
OFF_WORDS = "LAND_SPEED is 30 on board, and 50 is assumed (land_m_s, the landing's last 10 m): set LAND_SPEED 50"


@pytest.mark.parametrize(
    ("note", "words"),
    [
        (Note("return_required_and", why=Note("return_altitude_unread")),
         "a safe return is required, and the return altitude on board could not be read"),
        (Note("return_required_elsewhere", judged_m=60.0, returns_m=15.0, setting="RTL_ALT 6000"),
         "a safe return is required; it was judged at 60 m above home, and this vehicle returns at 15 m: set RTL_ALT "
         "6000"),
        (Note("parameters_unanswered", names=("WPNAV_RADIUS or WP_RADIUS_M", "RTL_ALT")),
         "WPNAV_RADIUS or WP_RADIUS_M, RTL_ALT could not be read from the vehicle, and no answer is not the default: "
         "try again, nearer or with a longer --timeout"),
        (Note("parameters_not_judged", allowed=True, off=(OFF,)),
         "it was judged with other values, and cannot be judged with these; --allow-parameters takes that\n  "
         + OFF_WORDS),
        (Note("parameters_not_judged", allowed=False, off=(OFF, OFF)),
         f"it was judged with other values, and cannot be judged with these\n  {OFF_WORDS}\n  {OFF_WORDS}"),
        (Note("breaks_limits_on_board",
              found=(OFF, Note("not_judged_on_board", why=Note("battery_lasts_unknown", 3)))),
         OFF_WORDS + "\nnot judged: item 3: how long the battery lasts there is not known, for hover_w is 0"),
        (Note("return_runs_farther", off=(OFF,)),
         "a safe return is required, and it runs on farther than was judged\n  " + OFF_WORDS),
        (Note("flight_takes_otherwise", takes_s=120.04, told_s=100.0, late_s=20.04, leans=False, off=(OFF,)),
         "the flight takes 120.0 s instead of 100.0 s (+20.0 s); --allow-parameters takes that\n  " + OFF_WORDS),
        (Note("flight_takes_otherwise", takes_s=90.0, told_s=100.0, late_s=-10.0, leans=True, off=()),
         "the flight takes 90.0 s instead of 100.0 s (-10.0 s), for ArduCopter before 4.5 takes corners with all that "
         "its lean allows; --allow-parameters takes that"),
        (Note("breaches_own_fence", found=(OFF,)), "the mission would breach its own fence:\n  " + OFF_WORDS),
        (Note("not_judged_in_time", timeout_s=0.6),
         "it could not be judged with this vehicle's parameters within 0.6 s: give more --timeout"),
    ],
)  # fmt: skip
def test_each_reason_is_said_in_one_sentence_with_what_to_set_below_it(note: Note, words: str) -> None:
    assert str(note) == words
    assert note.as_dict()["code"] == note.code


def job(**keys: Any) -> UploadJob:
    """The upload of a copter that lands a kilometre away, with its parameters judged."""
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10],
        "start": [36.6, -84.3], "goal": [36.6, -84.29],
    }  # fmt: skip
    planned = plan({
        "version": 1, "terrain": {"flat_m": 100},
        "limits": {"min_agl_m": 30}, "vehicles": [vehicle | keys],
    })  # fmt: skip
    [found] = jobs_of(planned, {"uav1": "udpout:127.0.0.1:9"})
    return found


def as_assumed(of: UploadJob, **other: float) -> OnBoard:
    """All parameters of a job's list as they are assumed, but for some."""
    read = {n.name: n.value(s.value) for s in settings_of(of) for n in s.parameter.names[:1]}
    return OnBoard(read | {"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 0.0} | other)


def refusal(of: UploadJob, values: OnBoard, **options: bool) -> Note | None:
    judge = judge_on_board(of, allow_unjudged=False, **options)
    assert judge is not None
    return judge(of.mission, values)


def test_assumed_parameters_are_taken_and_what_is_off_is_named() -> None:
    made = job()
    assert refusal(made, as_assumed(made)) is None
    [land] = [s.parameter.names[0] for s in settings_of(made) if s.parameter.key == "land"]
    slowly = {land.name: land.value(0.2)}
    slow = refusal(made, as_assumed(made, **slowly))
    assert slow is not None
    assert slow.code == "flight_takes_otherwise"
    [off] = slow.data["off"]  # type: ignore[misc]
    assert isinstance(off, Note)
    assert (off.code, off.data["name"], off.data["why"]) == (
        "parameter_not_assumed", land.name, Note("assumed_last_ten_metres"),
    )  # fmt: skip
    assert refusal(made, as_assumed(made, **slowly), allow_parameters=True) is None


def test_silence_is_its_own_code_with_the_names_that_gave_no_answer() -> None:
    made = job()
    values = as_assumed(made)
    del values["WPNAV_RADIUS"]
    silent = refusal(made, values)
    assert silent is not None
    assert (silent.code, silent.data["names"]) == ("parameters_unanswered", ("WPNAV_RADIUS or WP_RADIUS_M",))


def test_what_breaks_a_limit_on_board_is_each_finding_as_data() -> None:
    made = job()
    assert made.vehicle is not None
    strict = replace(made, vehicle=replace(made.vehicle, limits=replace(made.vehicle.limits, min_agl_m=200.0)))
    low = refusal(strict, as_assumed(strict))
    assert low is not None
    assert low.code == "breaks_limits_on_board"
    assert low.data["found"]
    assert all(isinstance(note, Note) for note in low.data["found"])  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_vehicle_whose_parameters_take_it_beyond_the_forecast_is_not_judged(tmp_path: Path) -> None:
    begin, end = datetime(2026, 11, 28, 13, 50, tzinfo=UTC), datetime(2026, 11, 28, 14, tzinfo=UTC)
    for _ in range(2):  # the second one lands as late as the forecast allows
        hours = [moment.strftime("%Y-%m-%dT%H:%M:%SZ") for moment in (begin, begin + timedelta(seconds=1))]
        [made] = jobs_of(
            plan(mission_in_forecast(tmp_path / "f.json", hours, (47.0, 8.02))), {"uav1": "udp:127.0.0.1:9"}
        )
        assert made.verdict is not None
        assert made.verdict.safe is True
        assert made.verdict.in_wind is not None
        assert made.verdict.in_wind.window is not None
        begin = end - timedelta(seconds=math.ceil(made.verdict.in_wind.window.latest_s[-1]) + 2.0)
    slow = as_assumed(made, LAND_SPEED=20.0)
    late = refusal(made, slow, allow_parameters=True)
    assert late is not None
    assert (late.code, late.data["why"].code) == ("not_judged_on_board", "flies_beyond_forecast")  # type: ignore[union-attr]
    early = replace(made, waits_s=-600.0)
    assert refusal(early, slow, allow_parameters=True) is None
