"""Zones as large as their files allow: read and placed in bounded time, or refused by name before the work is done."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.zones import draft as zone_draft
from gcsplan.mission_file.zones.draft import MOST_ZONE_CORNERS
from gcsplan.world.geometry.zones import Polygon
from gcsplan.world.zone_table import MOST_LISTED, lattice_over
from tests.campaigns import large_inputs, sizes


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def within_s() -> Iterator[list[float]]:
    """The most seconds of the processor that the test may take, to be put in."""
    most: list[float] = []
    begun = time.process_time()
    yield most
    assert time.process_time() - begun < most[0]


def said(kind: str, count: int) -> str:
    """What the refusal of a mission with zones of that kind says; its notes if it is not refused."""
    sizes.write(kind, count)
    try:
        return "\n".join(map(str, load_mission("m.yaml").notes))
    except InputError as refusal:
        return "\n".join(str(p) for p in refusal.problems)


@pytest.mark.nightly
def test_an_outline_of_99_000_spikes_is_refused_by_its_name(within_s: list[float]) -> None:
    within_s.append(8.0)  # minutes before
    assert "features[0].geometry.coordinates: the outline has 99000 corners" in said("corners", 99_000)


@pytest.mark.slow
def test_a_coast_of_30_000_corners_is_drawn_wider_with_a_note(within_s: list[float]) -> None:
    within_s.append(8.0)
    sizes.write("coast", 30_000)
    mission = load_mission("m.yaml")
    (zone,) = mission.zones
    assert isinstance(zone.shape, Polygon)
    assert len(zone.shape.vertices) <= MOST_ZONE_CORNERS
    assert "zone_outline_widened" in [note.code for note in mission.notes]


@pytest.mark.nightly
def test_a_ring_of_3_000_random_corners_is_not_untangled(within_s: list[float]) -> None:
    within_s.append(5.0)  # 150 s and 4 GB before
    assert "its outline of 3000 corners is too tangled to tell what it encloses" in said("crossing", 3000)


def test_a_ring_that_crosses_itself_a_hundred_times_is_untangled() -> None:
    assert "too tangled" not in said("crossing", 30)


@pytest.mark.nightly
def test_ten_thousand_arcs_are_counted_before_they_are_drawn(within_s: list[float]) -> None:
    within_s.append(5.0)  # 49 s and 1.1 GB before
    assert "its outline has 10000 points and arcs, drawn with" in said("arcs", 10_000)


@pytest.mark.nightly
def test_where_half_a_metre_does_not_help_the_message_says_what_would(within_s: list[float]) -> None:
    within_s.append(20.0)
    assert "its outline has 28000 corners, more than 20000; simplify it: drawn up to 1 m wider it has" in said(
        "corners", 28_000
    )


@pytest.mark.nightly
def test_a_corridor_of_4_000_random_points_is_placed_in_seconds(within_s: list[float]) -> None:
    within_s.append(10.0)  # 36 s before
    sizes.write("corridor", 4000)
    assert len(load_mission("m.yaml").zones) > 1000


@pytest.mark.parametrize(("amount", "what"), [(500, ""), (501, "at most 500")])
def test_via_points_are_counted(amount: int, what: str) -> None:
    assert what in said("vias", amount)


def test_vehicles_are_counted() -> None:
    large_inputs.mission(vehicles=[0] * 2001)
    with pytest.raises(InputError) as refusal:
        load_mission("m.yaml")
    assert "must be a list of 1 to 2000 vehicles, given" in str(refusal.value.problems)


def test_terrain_files_are_counted() -> None:
    large_inputs.mission(terrain={"dem": [f"t{k}.tif" for k in range(2001)], "vertical_datum": "EGM96"})
    with pytest.raises(InputError) as refusal:
        load_mission("m.yaml")
    assert "2000" in str(refusal.value.problems)


@pytest.mark.nightly
def test_mistakes_are_counted(within_s: list[float]) -> None:
    within_s.append(6.0)  # 10,000 lines: 30 s before, and 25 minutes for a file of 5 MB
    large_inputs.mission()
    text = Path("m.yaml").read_text() + "".join(f"k{k}: 1\n" for k in range(10_000))
    Path("m.yaml").write_text(text)
    with pytest.raises(InputError) as refusal:
        load_mission("m.yaml")
    assert len(refusal.value.problems) == 101
    assert "has 9900 more mistakes, which are not listed" in str(refusal.value.problems[-1])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("z.geojson", '{"type": "FeatureCollection", "features": [' + "1," * 100_000 + "1]}", "features[999]"),
        ("z.txt", "AC R\n" * 50_000, "z.txt: line 10"),
        ("z.kml", "<kml>" + "<a>" * 2_000_001, "the KML has more than 2000000 tags"),
    ],
    ids=["geojson", "openair", "kml"],
)
def test_what_is_no_zone_is_counted_too(name: str, text: str, words: str, within_s: list[float]) -> None:
    within_s.append(2.0)
    Path(name).write_text(text)
    large_inputs.mission([{"file": name}])
    with pytest.raises(InputError) as refusal:
        load_mission("m.yaml")
    assert len(refusal.value.problems) <= 1001
    assert words in str(refusal.value)


@pytest.mark.nightly
def test_zones_that_all_lie_over_each_other_take_little_memory() -> None:
    box = np.array([[-6e4, -6e4, 6e4, 6e4]]) + np.random.default_rng(1).uniform(-1e4, 1e4, (20_000, 1))
    lattice, bucket, near = lattice_over(box)
    assert len(near) <= MOST_LISTED  # 300 million before
    assert bucket[-1] == len(near)
    at = ((box[7, :2] - lattice[:2]) * lattice[2]).astype(int)
    square = int(at[1] * lattice[3] + at[0])
    assert 7 in near[bucket[square] : bucket[square + 1]]


@pytest.mark.slow
def test_great_circles_of_many_zones_are_counted_together(
    within_s: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    within_s.append(5.0)
    monkeypatch.setattr(zone_draft, "MOST_ALL_CORNERS", 20_000)
    assert "more than 20000 together; simplify them, or give a file of those around" in said("great_circles", 1000)
