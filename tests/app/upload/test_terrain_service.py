"""What a vehicle says of its terrain decides whether a mission in the terrain frame is sent to it."""

from __future__ import annotations

import pytest

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.upload.on_board import judge_on_board, settings_of
from gcsplan.app.upload.run import jobs_of
from gcsplan.mavlink.link.terrain import OFF
from gcsplan.mavlink.mission.parameter_names import OnBoard

MISSION = {
    "version": 1, "terrain": {"flat_m": 300}, "altitude_frame": "terrain", "terrain_error_m": 5,
    "limits": {"min_agl_m": 60, "altitude_error_m": 5},
    "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.59, -84.25],
                  "goal": [36.6, -84.25], "speed_m_s": [3, 9]}],
}  # fmt: skip


def test_the_check_before_sending_counts_what_the_vehicle_may_shift() -> None:
    planned = plan(load_mission(MISSION))
    [job] = jobs_of(planned, {"uav1": "udpout:127.0.0.1:9"})
    assert job.ground is not None
    again = judge_on_board(job, allow_unjudged=False)
    assert again is not None
    for values, sent in (
        ({}, True),  # by the file's own error
        ({"TERRAIN_OFS_MAX": 5.0, OFF: 0.4}, True),  # the planner keeps half a metre for it
        ({"TERRAIN_OFS_MAX": 5.0, OFF: 0.6}, False),
        ({"TERRAIN_OFS_MAX": 30.0, OFF: 0.0}, False),
        ({"TERRAIN_OFS_MAX": 30.0}, False),
        ({"TERRAIN_OFS_MAX": 0.0, OFF: 0.0}, True),
    ):
        assert (again(job.mission, values) is None) == sent, values
    assert "too low above ground" in str(again(job.mission, {"TERRAIN_OFS_MAX": 30.0}))


@pytest.mark.parametrize("spacing", [30.0, 100.0, 400.0])
def test_other_posts_are_judged_as_such(spacing: float) -> None:
    planned = plan(load_mission(MISSION))
    [job] = jobs_of(planned, {"uav1": "udpout:127.0.0.1:9"})
    again = judge_on_board(job, allow_unjudged=False)
    assert again is not None
    assert again(job.mission, {"TERRAIN_SPACING": spacing, "TERRAIN_OFS_MAX": 5.0, OFF: 0.0}) is None


def test_posts_of_which_nothing_is_known_are_not_the_default_ones() -> None:
    planned = plan(load_mission(MISSION))
    [job] = jobs_of(planned, {"uav1": "udpout:127.0.0.1:9"})
    again, settings = judge_on_board(job, allow_unjudged=False), settings_of(job)
    assert again is not None
    read = {n.name: n.value(s.value) for s in settings for n in s.parameter.names[:1]} | {
        "TERRAIN_ENABLE": 1.0,
        "FENCE_ENABLE": 0.0,
        "FENCE_AUTOENABLE": 0.0,
        OFF: 0.0,
    }
    for silent in ("TERRAIN_SPACING", "TERRAIN_OFS_MAX"):
        answered = {"TERRAIN_SPACING": 100.0, "TERRAIN_OFS_MAX": 5.0} | read
        assert again(job.mission, OnBoard(answered)) is None
        answered.pop(silent)
        assert f"{silent} could not be read" in str(again(job.mission, OnBoard(answered)))
