"""The fence of a `.plan` as zones and keep-in areas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file.zones.plan_fence import read_plan_fence

CIRCLE = {"circle": {"center": [46.01, 14.01], "radius": 300}, "inclusion": True, "version": 1}
POLYGON = {"polygon": [[46.0, 179.99], [46.0, -179.99], [46.01, 179.99]], "inclusion": False, "version": 1}


def plan_of(**fence: Any) -> dict[str, Any]:
    return {"fileType": "Plan", "geoFence": {"version": 2, **fence}}


def test_inclusions_keep_in_and_exclusions_are_no_fly_across_the_antimeridian() -> None:
    found = read_plan_fence(Path("f.plan"), plan_of(circles=[CIRCLE], polygons=[POLYGON]))
    assert [(d.name, d.keep_in, d.radius_m, d.floor) for d in found.zones] == [
        ("f[0]", True, 300.0, None), ("f[1]", False, None, None),
    ]  # fmt: skip
    assert found.zones[1].points[1] == pytest.approx((46.0, 180.01))
    assert not found.problems


@pytest.mark.parametrize(
    ("whole", "said"),
    [
        ([], "the plan has no fence"),
        ({"geoFence": {"version": 2}}, "the plan has no fence"),
        (plan_of(circles=[CIRCLE | {"maxAltitude": 50}]), "not read: geoFence.circles[0].maxAltitude; open the file"),
        ({"geoFence": {"version": 1, "polygon": [[1, 2]]}}, "not read: geoFence of version 1"),
        (plan_of(circles=[{"inclusion": True}]), "f.plan: geoFence.circles[0].circle"),
        (plan_of(polygons=[{"inclusion": True, "polygon": [[1, 2]]}]), "must have at least 3 corners"),
    ],
)
def test_a_fence_that_is_not_read_as_a_whole_is_refused_with_its_place(whole: Any, said: str) -> None:
    with pytest.raises(InputError) as found:
        read_plan_fence(Path("f.plan"), whole)
    assert said in str(found.value)


def test_an_outline_that_crosses_itself_is_a_problem_at_its_area() -> None:
    crossed = {"polygon": [[46.0, 14.0], [46.01, 14.01], [46.01, 14.0], [46.0, 14.01]], "inclusion": True, "version": 1}
    found = read_plan_fence(Path("f.plan"), plan_of(polygons=[crossed]))
    assert "crosses or touches itself" in found.refusals[0].message
    assert found.refusals[0].where.startswith("f.plan: geoFence: area 1")
