"""What the searches of one problem share is made once, and only where it is needed."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.profile.track import Flown, Obstruction
from gcsplan.world.geometry.path import track_length_m
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def test_lattices_and_outlines_are_made_once() -> None:
    work = work_of(over_flat(DISC))
    assert work.known_outlines is None
    assert work.outlines() is work.outlines() is work.known_outlines
    assert work.plane is work.plane
    assert len(work.plane.legs) == 1


def test_the_straight_track_leads_through_all_terminals() -> None:
    track, flown = work_of(over_flat()).straight
    assert track_length_m(track.points) == pytest.approx(1400.0)
    assert isinstance(flown, Flown)
    assert np.allclose(track.points[[0, -1]], [[300.0, 1000.0], [1700.0, 1000.0]])


def test_through_a_zone_the_straight_track_says_what_obstructs_it() -> None:
    _, flown = work_of(over_flat(DISC)).straight
    assert isinstance(flown, Obstruction)
    assert flown.zone == 0
    assert flown.s0_m < 700.0 < flown.s1_m
