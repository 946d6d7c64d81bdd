"""The motion of one vehicle: where it is at a time, before it leaves and after it lands, and what is no motion."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.fleet.motion.timed_path import TimedPath

TIMES = np.array([10.0, 12.0, 16.0])
POINTS = np.array([[0.0, 0.0, 5.0], [4.0, 2.0, 5.0], [4.0, 10.0, 9.0]])


def test_a_vehicle_is_between_its_points_in_time_and_stands_before_and_after() -> None:
    path = TimedPath("uav1", TIMES, POINTS, 16.0)
    assert (path.begin_s, path.end_s) == (10.0, 16.0)
    assert path.at([0.0, 11.0, 14.0, 99.0]).tolist() == [
        [0.0, 0.0, 5.0], [2.0, 1.0, 5.0], [4.0, 6.0, 7.0], [4.0, 10.0, 9.0],
    ]  # fmt: skip


def test_a_later_start_moves_all_times_and_nothing_else() -> None:
    path = TimedPath("uav1", TIMES, POINTS, 15.0, ends_in_air=True, pieces=np.array([3, 4]))
    later = path.delayed(2.5)
    assert later.times_s.tolist() == (TIMES + 2.5).tolist()
    assert (later.arrive_s, later.name, later.ends_in_air) == (17.5, "uav1", True)
    assert later.points is path.points
    assert later.pieces is path.pieces
    assert np.array_equal(later.at(TIMES + 2.5), path.at(TIMES))


@pytest.mark.parametrize(
    ("times", "points", "said"),
    [
        (TIMES[:1], POINTS[:1], "are not a motion"),
        (TIMES, POINTS[:2], "are not a motion"),
        (np.array([1.0, 1.0, 2.0]), POINTS, "do not rise"),
    ],
)
def test_what_is_no_motion_is_refused(times: np.ndarray, points: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        TimedPath("uav1", times, points, 2.0)
