"""Encodings and curves: inside their bounds, through all terminals, and each as its paper defines it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem, Via
from gcsplan.research.swarm.encodings import ENCODINGS, LATERAL, OFFSET, Code, get_encoding, shares
from gcsplan.research.swarm.objectives import curve
from gcsplan.research.swarm.scene import GROWN, Scene
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import draws
from tests.support.planner_worlds import FIELD, ground, jacksboro, random_mission


def hills(east: np.ndarray, north: np.ndarray) -> np.ndarray:
    return 100.0 + 80.0 * np.sin(east / 300.0) * np.cos(north / 250.0)


def problem(via: tuple[Via, ...] = ()) -> Problem:
    air = Airspace(ground(hills))
    limits = Limits(min_agl_m=30.0, max_agl_m=120.0)
    a, b = (300.0, 400.0), (1700.0, 1300.0)
    low = air.floor_amsl([a[0], b[0]], [a[1], b[1]], limits)
    return Problem(air, limits, (*a, float(low[0]) + 5.0), (*b, float(low[1]) + 5.0), via)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.of(problem())


@pytest.mark.parametrize("name", ENCODINGS)
@given(seed=st.integers(0, 2**31), points=st.integers(1, 12), corner=st.booleans())
@settings(max_examples=draws(25))
def test_control_points_lie_in_the_volume_and_the_stops_are_among_them(
    name: str, seed: int, points: int, corner: bool
) -> None:
    scene = SCENE
    code = Code.of(name, scene, points)
    u = np.random.default_rng(seed).random((5, code.dim))
    u = np.round(u) if corner else u
    controls = code.controls(u)
    assert controls.shape == (5, points + 2, 3)
    assert (controls >= scene.low - 1e-9).all()
    assert (controls <= scene.high + 1e-9).all()
    assert (controls[:, 0] == scene.terminals[0]).all()
    assert (controls[:, -1] == scene.terminals[-1]).all()


SCENE = Scene.of(problem())


@pytest.mark.parametrize("name", ENCODINGS)
def test_each_row_is_decoded_on_its_own(name: str, scene: Scene) -> None:
    code = Code.of(name, scene, 4)
    u = np.random.default_rng(3).random((6, code.dim))
    together = code.controls(u)
    for i in range(6):
        np.testing.assert_array_equal(code.controls(u[i : i + 1])[0], together[i])


def test_a_box_is_the_volume_scaled(scene: Scene) -> None:
    code = Code.of("box", scene, 2)
    controls = code.controls(np.array([[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]]))[0]
    np.testing.assert_allclose(controls[1], scene.low)
    np.testing.assert_allclose(controls[2], scene.high)
    wanted = scene.low + np.array([0.2, 0.7, 0.4]) * (scene.high - scene.low)
    u = ((wanted - scene.low) / (scene.high - scene.low)).tolist()
    np.testing.assert_allclose(code.controls(np.array([u * 2]))[0][1], wanted)


def test_polar_coordinates_are_radii_and_those_beyond_one_lie_on_the_circle(scene: Scene) -> None:
    code = Code.of("polar", scene, 1)
    at = code.controls(np.array([[0.3, 0.4, 0.9, 0.9, 0.0, 0.0]]))[0][1]
    np.testing.assert_allclose((at - scene.low) / (scene.high - scene.low), [0.5, 1.0, 0.0], atol=1e-12)


def test_signed_polar_coordinates_are_radii_from_the_middle_of_the_variables(scene: Scene) -> None:
    code = Code.of("polar-signed", scene, 1)
    at = code.controls(np.array([[0.35, 0.7, 0.05, 0.95, 0.5, 0.5]]))[0][1]
    np.testing.assert_allclose((at - scene.low) / (scene.high - scene.low), [0.5, 1.0, 0.0], atol=1e-12)


def test_sections_stand_across_the_track_between_floor_and_ceiling(scene: Scene) -> None:
    code = Code.of("sections", scene, 3)
    a, b = scene.terminals[0], scene.terminals[-1]
    ahead = (b - a)[:2]
    long = math.hypot(*ahead)
    u = np.full((1, 6), 0.5)
    u[0, 2:4] = 0.8, 0.0
    points = code.controls(u)[0][1:-1]
    along = (points[:, :2] - a[:2]) @ ahead / long
    aside = (points[:, :2] - a[:2]) @ np.array([-ahead[1], ahead[0]]) / long
    np.testing.assert_allclose(along, long * np.array([0.25, 0.5, 0.75]))
    np.testing.assert_allclose(aside, [0.0, 0.6 * LATERAL * long, 0.0], atol=1e-9)
    top = np.array([hills(x, y) for x, y in points[:, :2]])
    above = points[:, 2] - top
    assert abs(above[1] - 30.0) < 0.5
    assert abs(above[0] - 75.0) < 0.5


def test_whole_sections_are_sections_rounded_to_metres(scene: Scene) -> None:
    u = np.random.default_rng(4).random((3, 8))
    plain, whole = (Code.of(name, scene, 4).controls(u) for name in ("sections", "sections-whole"))
    assert (whole[:, 1:-1] == np.round(plain[:, 1:-1])).all()
    assert (whole[:, [0, -1]] == plain[:, [0, -1]]).all()


def test_offsets_reach_a_quarter_aside_at_altitudes_of_the_volume(scene: Scene) -> None:
    code = Code.of("offsets", scene, 1)
    point = code.controls(np.array([[1.0, 0.25]]))[0][1]
    a, b = scene.terminals[0], scene.terminals[-1]
    assert math.isclose(np.hypot(*(point - 0.5 * (a + b))[:2]), OFFSET * np.hypot(*(b - a)[:2]))
    assert math.isclose(point[2], scene.low[2] + 0.25 * (scene.high[2] - scene.low[2]))


def test_a_bspline_point_stays_about_its_station(scene: Scene) -> None:
    code = Code.of("bspline", scene, 4)
    a, b = scene.terminals[0], scene.terminals[-1]
    ahead = (b - a)[:2]
    middle = code.controls(np.full((1, 12), 0.5))[0][1:-1]
    np.testing.assert_allclose((middle[:, :2] - a[:2]) @ ahead / (ahead @ ahead), [0.2, 0.4, 0.6, 0.8])


def test_via_points_are_stops_of_every_path_and_points_are_shared_by_length() -> None:
    p = problem((Via(600.0, 500.0), Via(700.0, 1000.0, 260.0)))
    scene = Scene.of(p)
    code = Code.of("bspline", scene, 9)
    assert sum(code.points) == 9
    assert code.points[2] == max(code.points)
    controls = code.controls(np.random.default_rng(1).random((3, code.dim)))
    line = curve(code.points, shares(200, np.linalg.norm(np.diff(scene.terminals, axis=0), axis=1)))
    samples = line.samples(controls)
    np.testing.assert_allclose(samples[:, line.terminals], np.broadcast_to(scene.terminals, (3, 4, 3)), atol=1e-9)
    assert scene.terminals[2, 2] == 260.0
    low, high = scene.room(scene.terminals[1:2])
    assert low[0] <= scene.terminals[1, 2] <= high[0]


def test_an_unknown_encoding_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"no encoding 'spiral'\. Known: box"):
        get_encoding("spiral")


@given(total=st.integers(1, 60), weights=st.lists(st.floats(0.0, 1e6), min_size=1, max_size=6))
def test_shares_are_whole_and_at_least_one_each(total: int, weights: list[float]) -> None:
    total = max(total, len(weights))
    parts = shares(total, np.array(weights))
    assert sum(parts) == total
    assert min(parts) >= 1


def test_the_volume_is_the_grown_square_about_the_stops_or_what_is_asked_for() -> None:
    p = problem()
    scene = Scene.of(p)
    np.testing.assert_allclose(scene.high[:2] - scene.low[:2], (1.0 + 2.0 * GROWN) * 1400.0)
    asked = Scene.of(p, {"west_m": 100.0, "east_m": 1900.0, "top_m": 400.0})
    assert (asked.low[0], asked.high[0], asked.high[2]) == (100.0, 1900.0, 400.0)
    with pytest.raises(InputError, match="must hold start"):
        Scene.of(p, {"east_m": 1000.0})


def test_the_scene_reads_the_raster_as_the_surface_does() -> None:
    p = random_mission(4, replace(FIELD, max_amsl_m=900.0))
    scene = Scene.of(p)
    rng = np.random.default_rng(0)
    at = scene.low[:2] + rng.random((500, 2)) * (scene.high - scene.low)[:2]
    surface = jacksboro().top_at(at[:, 0], at[:, 1])
    known = np.isfinite(surface)
    assert known.mean() > 0.5
    # The quadratic map is off by less than 1 m over 20 km, which is a few decimetres of height on a slope.
    np.testing.assert_allclose(scene.ground(at)[known], surface[known], atol=0.5)


def test_ground_off_the_raster_is_unknown(scene: Scene) -> None:
    assert np.isnan(scene.ground(np.array([[-5000.0, 0.0], [2001.0, 500.0]]))).all()


@pytest.mark.parametrize("free", [1, 2, 3, 8])
def test_a_curve_is_scipys_clamped_cubic(free: int) -> None:
    rng = np.random.default_rng(free)
    controls = rng.random((free + 2, 3))
    degree = min(3, free + 1)
    knots = np.r_[np.zeros(degree), np.linspace(0.0, 1.0, free + 3 - degree), np.ones(degree)]
    wanted = BSpline(knots, controls, degree)(np.linspace(0.0, 1.0, 51))
    line = curve((free,), (50,))
    np.testing.assert_allclose(line.samples(controls), wanted, atol=1e-12)
    np.testing.assert_allclose(line.basis.sum(axis=0), 1.0)


@pytest.mark.parametrize(
    ("points", "legs"), [((1,), (9,)), ((1, 1), (3, 2)), ((2, 1, 5), (8, 3, 20)), ((30,), (186,)), ((9, 4), (1, 1))]
)
def test_what_kernels_have_of_a_basis_is_the_whole_of_it(points: tuple[int, ...], legs: tuple[int, ...]) -> None:
    line = curve(points, legs)
    whole = np.zeros_like(line.basis)
    seen = np.zeros(line.basis.shape[1], int)
    for begin, end, first in line.spans:
        seen[begin:end] += 1
        for k, row in enumerate(line.bands[:, begin:end]):
            if first + k < len(whole):
                whole[first + k, begin:end] = row
            else:
                assert not row.any()
    np.testing.assert_array_equal(whole, line.basis)
    assert (seen == 1).all()
    controls = np.random.default_rng(1).random((5, len(whole), 3))
    np.testing.assert_allclose(line.samples(controls), np.einsum("cs,ncd->nsd", line.basis, controls), atol=1e-12)
    np.testing.assert_array_equal(line.samples(controls)[:, line.terminals[0]], controls[:, 0])
    np.testing.assert_array_equal(line.samples(controls)[:, line.terminals[-1]], controls[:, -1])
