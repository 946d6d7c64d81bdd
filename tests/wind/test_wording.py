"""The sentence on declared winds, and the arc that holds all their directions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.notes.note import Wording
from gcsplan.units import AVIATION
from gcsplan.wind.declared import STILL_AIR, DeclaredWind
from gcsplan.wind.wording import arc_deg, as_dict, wind_note


def of(speed, direction, **rest):
    return DeclaredWind(np.array([[speed]], dtype=float), np.array([[direction]], dtype=float), **rest)


@pytest.mark.parametrize(
    ("wind", "words"),
    [
        (STILL_AIR, "still air: times, energies and paths count no wind"),
        (of((5, 5), (270, 270)), "declared wind: 5.0 m/s from 270°; one wind during the whole flight"),
        (of((3, 7), (350, 380)), "declared wind: 3.0 to 7.0 m/s from 350° to 20°; one wind during the whole flight"),
        (of((0, 8), (0, 360), varying=True), "0.0 to 8.0 m/s from any direction; another one at each place and time"),
        (of((5, 5), (0, 0), gust_m_s=9.0), "from 0°; one wind during the whole flight; gusts up to 9.0 m/s"),
    ],
)
def test_a_wind_is_one_sentence(wind, words):
    assert str(wind_note(wind)).endswith(words)


def test_the_sentence_is_in_the_readers_units():
    assert "9.7 kt from 270°" in wind_note(of((5, 5), (270, 270))).text(Wording(AVIATION))


@given(st.lists(st.tuples(st.floats(-360, 360), st.floats(0, 200)), min_size=1, max_size=6))
def test_the_smallest_arc_holds_every_arc_and_has_no_larger_gap(arcs):
    ranges = np.array([(low, low + width) for low, width in arcs])
    low, high = arc_deg(ranges)
    assert 0.0 <= low <= 360.0
    assert 0.0 <= high - low <= 360.0
    inside = (ranges[:, 0] - low + 1e-6) % 360.0 - 1e-6
    assert high - low >= 360.0 or (inside + ranges[:, 1] - ranges[:, 0] <= high - low + 1e-6).all()
    # Among all arcs that begin with one of them and hold the others, none is smaller.
    spans = [((ranges[:, 0] - b) % 360.0 + ranges[:, 1] - ranges[:, 0]).max() for b in ranges[:, 0]]
    assert high - low <= min(*spans, 360.0) + 1e-6


def test_a_set_for_programs_names_its_heights_and_hours():
    wind = DeclaredWind(np.ones((2, 1, 2)), np.zeros((2, 1, 2)), times_s=np.array([0.0, 3600.0]))
    assert as_dict(wind)["times"] == ["1970-01-01T00:00:00+00:00", "1970-01-01T01:00:00+00:00"]
    assert as_dict(STILL_AIR)["times"] == []
    assert as_dict(STILL_AIR)["still"] is True
