"""Every mission of the gallery is planned, judged, written and read again; the papers' have a test of their own."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from gcsplan import load_mission, plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.plan.way_home import homes_of
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mavlink.mission.compare import compare, faults
from tests.support.paths import MISSIONS

SLOW = {"fleet-4", "jacksboro-high", "jacksboro-wing"}
NIGHTLY = {"fleet-100"}


def marks(file: Path) -> list[pytest.MarkDecorator]:
    """Which suite plans a mission, once for all tests of its group."""
    kind = [pytest.mark.slow] * (file.stem in SLOW) + [pytest.mark.nightly] * (file.stem in NIGHTLY)
    return [pytest.mark.xdist_group(file.stem), *kind]


planned_once = cache(lambda file: plan(load_mission(file)))


@pytest.mark.parametrize("file", [pytest.param(f, id=f.stem, marks=marks(f)) for f in MISSIONS.glob("*.yaml")])
def test_a_mission_of_the_gallery_is_safe_and_its_files_are_what_was_judged(file: Path, tmp_path: Path) -> None:
    planned = planned_once(file)
    files = outputs_of(planned)
    assert {v.verdict.safe for v in planned.vehicles} == {True}
    if planned.fleet is not None and planned.fleet.separation is not None:
        assert planned.fleet.separation.safe
    for vehicle in planned.vehicles[:4]:
        written = tmp_path / f"{vehicle.name}.plan"
        written.write_text(files[written.name], encoding="utf-8")
        read = read_mission_file(written, autopilot=None)
        sent, stored = vehicle.mission.wire_items(), read.mission.wire_items()
        assert not faults(compare(sent, stored, vehicle.mission.autopilot))


@pytest.mark.slow
@pytest.mark.parametrize("file", [pytest.param(f, id=f.stem, marks=marks(f)) for f in MISSIONS.glob("*.yaml")])
def test_every_mission_of_the_gallery_has_a_safe_return_from_all_of_its_paths(file: Path) -> None:
    homes = homes_of(planned_once(file))
    for name, home in homes.items():
        if file.stem == "fleet-100" and home.unsafe:  # as the mission says
            assert sum(s.to_m - s.from_m for s in home.unsafe) <= 75.0, name
            assert all("quarry" in str(s.why) for s in home.unsafe), name
        else:
            assert (str(home.headline), home.set_leaves_m) == ("path safe; safe return from all of it", 0.0), name


@pytest.mark.nightly
def test_proposed_rally_points_stand_in_the_plan_file_on_request_alone() -> None:
    endless = (MISSIONS / "jacksboro.yaml").read_text(encoding="utf-8").replace(", ceiling_amsl_m: 900", "")
    planned = plan(load_mission("jacksboro.yaml", text=endless))
    homes = homes_of(planned)
    points = homes["uav1"].rally
    assert points
    asked, plain = (json.loads(outputs_of(planned, homes, rally=on)["uav1.plan"]) for on in (True, False))
    written = asked["rallyPoints"]["points"]
    assert [tuple(p) for p in written] == [(p.lat_deg, p.lon_deg, p.rel_home_m) for p in points]
    assert plain["rallyPoints"]["points"] == []
