"""Which reader takes a published file: each takes its own format alone, and what none takes is left to others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.mission_file.published.ed269 import is_ed269
from gcsplan.mission_file.published.ed318 import is_ed318
from gcsplan.mission_file.published.members import MemberError, number_or_none, outer_ring, position, text_of, unread
from gcsplan.mission_file.published.openaip import is_openaip
from gcsplan.mission_file.published.openair import read_openair
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.zone_reader import read_published
from gcsplan.world.terrain.input_files import OPENAIR_ZONES
from tests.mission_file.published.made import HOLE, RING, collection, ed269, ed318, openaip, volume

POLICY = Policy(where="m: no_fly[0]")
OPENAIR = (
    b"AC R\nAN alone\nAL GND\nAH 500 FT MSL\n"
    b"DP 47:00:00 N 008:00:00 E\nDP 47:01:00 N 008:00:00 E\nDP 47:00:30 N 008:01:00 E\n"
)
MADE: dict[str, Any] = {
    "ed269": {"title": "made", "features": [ed269(volume())]},
    "ed318": collection(ed318()),
    "openaip": {"items": [openaip()]},
}
PLAIN = {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": None, "properties": {"name": "a"}}]}


@pytest.mark.parametrize("whole", [*MADE.values(), PLAIN, None, 5, [], {}, [None], {"features": [5]}])
def test_a_value_is_of_one_format_at_most(whole: Any) -> None:
    readers = {"ed269": is_ed269, "ed318": is_ed318, "openaip": is_openaip}
    taken = [name for name, takes in readers.items() if takes(whole)]
    assert taken == [name for name, made in MADE.items() if made is whole]


@pytest.mark.parametrize("name", MADE)
def test_a_published_file_gives_its_zone(name: str) -> None:
    found = read_published(Path("z.json"), json.dumps(MADE[name]).encode(), MADE[name], POLICY)
    assert found is not None
    assert found.problems == []
    assert len(found.zones) == 1


def test_a_file_of_none_of_these_formats_is_left_to_others() -> None:
    assert read_published(Path("z.geojson"), b"", PLAIN, POLICY) is None


@pytest.mark.parametrize("suffix", OPENAIR_ZONES)
def test_openair_is_taken_by_its_ending(suffix: str) -> None:
    found = read_published(Path(f"z{suffix}"), OPENAIR, None, POLICY)
    assert found is not None
    assert [zone.name for zone in found.zones] == ["alone"]
    assert [zone.name for zone in read_openair(Path("z.txt"), OPENAIR, POLICY).zones] == ["alone"]


# -- members of JSON


def test_an_outline_is_its_ring_without_the_closing_corner_and_holes_are_counted() -> None:
    corners, holes = outer_ring([RING, HOLE])
    assert holes == 1
    assert [tuple(corner)[:2] for corner in corners] in (
        [(lat, lon) for lon, lat in RING], [(lat, lon) for lon, lat in RING[:-1]],
    )  # fmt: skip


@pytest.mark.parametrize("given", [None, 5, [1], ["8", "47"], [8.0, 97.0], [float("nan"), 1.0]])
def test_a_position_that_is_none_is_refused(given: Any) -> None:
    with pytest.raises(MemberError):
        position(given)


def test_a_number_may_be_missing_or_a_text_and_is_nothing_else() -> None:
    assert number_or_none(None, "lower") is None
    assert number_or_none(120, "lower") == 120
    assert number_or_none(" -12.5 ", "lower") == -12.5
    for given in ("12 m", "nan", True, [1]):
        with pytest.raises(MemberError, match="lower"):
            number_or_none(given, "lower")


def test_a_text_in_several_languages_is_one_text_and_unread_members_are_named() -> None:
    assert text_of("a") == "a"
    assert text_of(None) == ""
    assert "mine" in "".join(map(str, unread({"name": "a", "mine": 1}, {"name"}, all_of_them=True)))
    assert unread({"name": "a"}, {"name"}, all_of_them=True) == []
