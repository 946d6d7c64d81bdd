"""Corners that an ArduCopter would cut too near to ground or zones are mended where they are, in height, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from gcsplan.app.corners import sharpened
from gcsplan.app.pipeline import plan
from gcsplan.bench.everyday.missions import draw
from gcsplan.mavlink.build.multirotor import SHORT_LEG_M
from gcsplan.mission_file import load_mission


def test_a_mission_over_hills_without_errors_is_planned_once() -> None:
    # Planned again with the margins of its short legs' climbs, it took 5,501 m.
    one = draw(11, 64)
    (found,) = plan(load_mission(Path(f"{one.kind}.yaml"), text=yaml.safe_dump(one.document))).vehicles
    assert found.verdict.safe is True
    assert found.cost < 5425.0
    assert not any("planned 2 times" in note for note in found.solution.notes)


def test_the_leg_behind_a_corner_is_no_steeper_than_the_next_whatever_is_rounded() -> None:
    points = np.array([[0.0, 0.0, 100.0], [500.0, 0.0, 200.0], [1000.0, 0.0, 330.0]])
    mended = sharpened(points, {1})
    assert len(mended) == 4
    run, rise = mended[2, 0] - mended[1, 0], mended[2, 2] - mended[1, 2]
    assert run == pytest.approx(SHORT_LEG_M)
    assert 0.0 <= rise <= max(0.26 * SHORT_LEG_M - 0.01, 0.0)
