"""Wings: a real ArduPlane takes off, climbs out, turns, glides, circles and returns as the check judges it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.app.rehearse import rehearse_in_sitl
from gcsplan.arrays import Floats
from gcsplan.check.verdict import LegFigures
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.outcome import Rehearsal
from gcsplan.vehicle import Autopilot
from sitl_tests import sitl
from tests.support.paths import REPOSITORY

pytestmark = sitl.needs(Autopilot.ARDUPLANE, program=True)

TRACK_M, HEIGHT_M, RADIUS_M, RTL_M = 10.0, 8.0, 100.0, 600.0
"""track_error_m, altitude_error_m, turn_radius_m and rtl_rel_home_m of the mission."""
NEAR = "[36.6095, -84.3300]"
PAD = "[36.6040, -84.3300]"


@dataclass(frozen=True, eq=False)
class Flown:
    """A plan and its flight in SITL."""

    planned: Plan
    result: Rehearsal

    @property
    def vehicle(self) -> VehiclePlan:
        return self.planned.vehicles[0]

    @property
    def trace(self) -> Trace:
        return self.result.flown[0]

    @property
    def home_amsl_m(self) -> float:
        return self.vehicle.mission.home.amsl_m

    def legs(self, *, column: bool) -> list[LegFigures]:
        return [leg for leg in self.vehicle.verdict.legs if leg.column is column and leg.length_m > 0.1]

    def plane(self, places: list[tuple[float, ...]]) -> Floats:
        """(N, 3) metres of places (latitude, longitude, amsl_m)."""
        flat = self.planned.world.frame.to_plane([p[0] for p in places], [p[1] for p in places])
        return np.column_stack([flat, [p[2] for p in places]])

    def off(self, points: Floats, legs: list[LegFigures]) -> tuple[Floats, Floats]:
        """How far points lie beside the nearest leg, m, and how far above it there (below: negative)."""
        start, end = self.plane([leg.start for leg in legs]), self.plane([leg.end for leg in legs])
        way = end - start
        flat = np.maximum((way[:, :2] ** 2).sum(-1), 1e-9)
        f = (((points[:, None, :2] - start[:, :2]) * way[:, :2]).sum(-1) / flat).clip(0.0, 1.0)
        foot = start + f[..., None] * way
        beside = np.linalg.norm(points[:, None, :2] - foot[..., :2], axis=-1)
        near = beside.argmin(axis=1)
        rows = np.arange(len(points))
        return beside[rows, near], points[:, 2] - foot[rows, near, 2]


def flown(folder: Path, goal: str, end: str) -> Flown:
    """The sample mission with another goal and end, flown."""
    text = (REPOSITORY / "missions" / "jacksboro-wing.yaml").read_text(encoding="utf-8")
    text = text.replace("[36.6133, -84.1667]", goal).replace("end: loiter", f"end: {end}")
    text = re.sub(r"\n *takeoff_heading_deg:.*", "", text)  # which is right for the sample's own goal
    if end == "rtl":  # it turns for home beside the ridge, and climbs on the way
        text = text.replace("end: rtl", "end: rtl\n    approach_agl_m: 320")
    if end == "land":  # the return from a low glide is not judged here
        text = text.replace("way_home: required", "")
    file = folder / f"{end}.yaml"
    file.write_text(text, encoding="utf-8")
    planned = plan(load_mission(file))
    binary = sitl.binary(Autopilot.ARDUPLANE)
    return Flown(planned, rehearse_in_sitl(planned, binary=binary, speedup=15.0))


@pytest.fixture(scope="module")
def circling(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return flown(tmp_path_factory.mktemp("circling"), NEAR, "loiter")


@pytest.fixture(scope="module")
def landing(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return flown(tmp_path_factory.mktemp("landing"), PAD, "land")


@pytest.fixture(scope="module")
def returning(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return flown(tmp_path_factory.mktemp("returning"), NEAR, "rtl")


def test_it_takes_off_and_climbs_out_over_the_judged_climb_out(circling: Flown) -> None:
    climb_out = list(takewhile(lambda leg: leg.column, circling.vehicle.verdict.legs))
    points = circling.trace.points[1:][circling.trace.column]
    beside, above = circling.off(points, climb_out)
    assert len(points) > 20
    assert beside.max() < TRACK_M
    assert above.min() > -HEIGHT_M


def test_it_flies_legs_as_they_are_judged(circling: Flown) -> None:
    _as_judged(circling)
    assert circling.result.breaches == ()


def test_it_flies_arcs_as_they_are_judged(landing: Flown) -> None:
    arcs = [leg for leg in landing.legs(column=False) if leg.length_m < 25.0]
    assert len(arcs) > 10
    _as_judged(landing)


def _as_judged(flight: Flown) -> None:
    """Every place outside of climb-out, glide and circle lies within the errors that the legs are judged with."""
    trace = flight.trace
    before = flight.trace.arrive_s - 1.5 * RADIUS_M / 20.0
    points = trace.points[1:][~trace.column & (trace.times_s[1:] < before)]
    assert len(points) > 500
    beside, above = flight.off(points, flight.legs(column=False))
    assert beside.max() < TRACK_M
    assert np.abs(above).max() < HEIGHT_M


def test_it_circles_about_its_goal(circling: Flown) -> None:
    trace = circling.trace
    goal = circling.plane([circling.vehicle.verdict.path_legs[-1].end])[0]
    circle = trace.points[trace.times_s > trace.times_s[-1] - 30.0]  # most of a round
    radius = np.linalg.norm((circle - goal)[:, :2], axis=1)
    assert np.abs(circle[:, 2] - goal[2]).max() < HEIGHT_M
    assert radius.min() > 0.95 * RADIUS_M
    # It was measured to fly 12 % wider than its radius.
    assert radius.max() < 1.15 * RADIUS_M + TRACK_M


def test_it_glides_to_its_pad_as_judged(landing: Flown) -> None:
    trace = landing.trace
    glide = [leg for leg in landing.legs(column=True) if leg.kind == "land"]
    (pad,) = landing.plane([glide[-1].end])
    touched = trace.points[-1]
    assert np.hypot(*(touched - pad)[:2]) < 60.0
    assert abs(touched[2] - pad[2]) < HEIGHT_M
    seq = landing.vehicle.mission.first_seq + len(landing.vehicle.mission.items) - 1
    points = trace.points[1:][trace.seq == seq]
    beside, above = landing.off(points, glide)
    assert beside.max() < TRACK_M + 5.0
    assert above.min() > -HEIGHT_M
    assert not [b for b in landing.result.breaches if b.kind != "min_agl"]


def test_it_returns_climbing_and_circles_about_home(returning: Flown) -> None:
    trace = returning.trace
    home = returning.plane([(36.6175, -84.3892, returning.home_amsl_m)])[0]
    back = trace.points[1:][trace.seq == returning.vehicle.mission.first_seq + len(returning.vehicle.mission.items) - 1]
    rising = np.diff(back[:, 2])
    assert rising.min() > -1.0
    assert back[-1, 2] - returning.home_amsl_m == pytest.approx(RTL_M, abs=HEIGHT_M)
    last = trace.points[trace.times_s > trace.times_s[-1] - 30.0]
    radius = np.linalg.norm((last - home)[:, :2], axis=1)
    assert radius.min() > 0.95 * RADIUS_M
    assert radius.max() < 1.15 * RADIUS_M + TRACK_M
