"""What a stranger's script hands in: each value in each place is taken, or refused by gcsplan with its place.

The values lie, raise, hold themselves, or are of types that no mission has; none may meet a TypeError from inside.
"""

from __future__ import annotations

import collections
import copy
import datetime
import decimal
import fractions
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.app import api
from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.session import Planner
from gcsplan.errors import GcsplanError, InputError
from gcsplan.planners.problem import Solution
from gcsplan.plugins import OUTPUTS, PLANNERS, ZONE_READERS, register_output, register_planner, register_zone_reader
from gcsplan.world.geometry.path import Path as Way
from tests.export.test_output_schema import FLAT
from tests.mission_file.test_memory_files import FEATURE, TERRAIN


class NoText:
    """Its own text raises."""

    def __repr__(self) -> str:
        raise RuntimeError("no text")


class NoList(list[Any]):
    """It can be neither counted nor walked through."""

    def __len__(self) -> int:
        raise RuntimeError("no length")

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError("no elements")


class NoMapping(Mapping[str, Any]):
    """It says that it has keys, and shows none."""

    def __getitem__(self, key: str) -> Any:
        raise RuntimeError("no value")

    def __len__(self) -> int:
        return 3

    def __iter__(self) -> Iterator[str]:
        raise RuntimeError("no keys")


class NoAttributes:
    """Whoever looks at it is punished."""

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError(name)


class AllAttributes:
    """It has every attribute, and each is a function."""

    def __getattr__(self, name: str) -> Any:
        return self

    def __call__(self, *_: Any) -> Any:
        return self


class NoPath:
    """A path without a name."""

    def __fspath__(self) -> str:
        raise RuntimeError("no path")


class NoString(str):
    """A text that cannot be written."""

    def __str__(self) -> str:
        raise RuntimeError("no string")


class NoShape:
    """GeoJSON that is none, or raises."""

    def __init__(self, made: Any) -> None:
        self._made = made

    @property
    def __geo_interface__(self) -> Any:
        if self._made is None:
            raise RuntimeError("no shape")
        return self._made


class NoArray:
    """An array without numbers; `tolist` gives itself."""

    def __array__(self, *_: Any) -> Any:
        raise RuntimeError("no array")

    def tolist(self) -> Any:
        return self


ROUND: list[Any] = []
ROUND.append(ROUND)
DEEP: Any = 1
for _ in range(3000):
    DEEP = [DEEP]

VALUES: list[Any] = [
    None, True, -1, 1e308, 10**400, 10**5000, math.nan, math.inf, "x", "1e3", "a\0b", "\ud800", "9" * 6000, b"x", [],
    {}, ROUND, DEEP, {1: 2}, {None: 1}, [1, "a", None, {}], ["36.5", "-84.3"], [10**400, 1], {1, 2}, range(3), slice(1),
    ..., NotImplemented, object(), int, len, ValueError("x"), 1j, decimal.Decimal("sNaN"), fractions.Fraction(1, 3),
    datetime.timedelta(1), np.zeros(0), np.full((3, 3), np.nan), np.array([None, object()], object),
    np.datetime64("NaT", "s"), np.ma.masked, collections.UserDict(a=1), Path("absent"),
    NoText(), NoList([1]), NoMapping(),
    NoAttributes(), AllAttributes(), NoPath(), NoString("x"), NoShape(None), NoShape(7), NoArray(),
]  # fmt: skip

ZONED = {**FLAT, "no_fly": [FEATURE | {"properties": {"name": "pond"}}]}
RASTER = {"version": 1, "limits": {"min_agl_m": 30}, "terrain": TERRAIN,
          "vehicles": [{**FLAT["vehicles"][0], "start": [36.5, -84.3], "goal": [36.52, -84.3]}]}  # fmt: skip
KEYS: list[tuple[Mapping[str, Any], tuple[str | int, ...]]] = [
    (FLAT, ("name",)), (FLAT, ("terrain",)), (FLAT, ("vehicles", 0)), (FLAT, ("vehicles", 0, "goal")),
    (FLAT, ("no_fly",)), (ZONED, ("no_fly", 0, "type")), (ZONED, ("no_fly", 0, "geometry", "coordinates")),
    (RASTER, ("terrain", "dem")), (RASTER, ("terrain", "transform")), (RASTER, ("terrain", "crs")),
]  # fmt: skip


def refused(call: Callable[[], Any]) -> str:
    """The message of the refusal, empty if there is none; any other error fails the test."""
    try:
        call()
    except GcsplanError as why:
        return str(why)
    return ""


@pytest.mark.parametrize(("whole", "place"), KEYS, ids=[".".join(map(str, place)) for _, place in KEYS])
def test_a_strange_value_of_a_key_is_refused_with_its_place(
    whole: Mapping[str, Any], place: tuple[str | int, ...]
) -> None:
    for value in VALUES:
        mission = copy.deepcopy(dict(whole))
        here: Any = mission
        for step in place[:-1]:
            here = here[step]
        here[place[-1]] = value
        message = refused(lambda mission=mission: load_mission(mission))
        assert not message or ": " in message, type(value)
        assert len(message) < 3000, type(value)


@pytest.mark.parametrize("name", ["source", "text", "planner_names", "around", "departure", "at", "terrain", "changes"])
def test_a_strange_argument_of_load_mission_is_refused_by_name(name: str) -> None:
    for value in VALUES:
        given = {"source": value} if name == "source" else {"source": None if name == "text" else FLAT, name: value}
        refused(lambda given=given: load_mission(**given))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("key", ["vehicles.uav1.goal", "no_fly.pond", "terrain", "vehicles[0]"])
def test_a_strange_change_leaves_the_session_as_it_was(key: str) -> None:
    for value in VALUES:
        session = Planner(FLAT)
        before = session.mission
        if refused(lambda session=session, value=value: session.change({key: value})):
            assert session.mission == before
    for value in VALUES:
        refused(lambda value=value: Planner(FLAT).change(value))


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(FLAT)


@pytest.mark.slow
def test_strange_arguments_of_the_functions_are_refused_by_name(planned: Plan, tmp_path: Path) -> None:
    for value in VALUES:
        calls = {
            "planned": lambda value=value: api.write(value, tmp_path),
            "report": lambda value=value: api.report(planned, tmp_path / "x.html", results=value, way_home=False),
            "units": lambda value=value: api.report(planned, units=value, way_home=False),
            "to": lambda value=value: api.upload(planned, [value]),
            "flat_m": lambda value=value: api.new("36.6,-84.3", "36.61,-84.3", flat_m=value),
            "dem": lambda value=value: api.new("36.6,-84.3", "36.61,-84.3", dem=[value]),
            "wind": lambda value=value: api.rehearse(planned, wind_m_s=value, seed=-1),
            "seed": lambda value=value: api.rehearse(planned, runs=0, seed=value),
            "mission": lambda value=value: api.fetch_dem([value]),  # type: ignore[arg-type]
            "options": lambda value=value: plan(FLAT, options=value, objective="x"),
            "objective": lambda value=value: plan(FLAT, objective="x", planner=value),
        }
        for call in calls.values():
            refused(call)


@pytest.fixture
def nothing_added() -> Iterator[None]:
    yield
    for added in (PLANNERS, OUTPUTS, ZONE_READERS):
        added.forget()


@pytest.mark.slow
@pytest.mark.usefixtures("nothing_added")
def test_strange_results_of_additions_are_refused_by_their_name(planned: Plan, tmp_path: Path) -> None:
    file = tmp_path / "a.strange"
    file.write_text("1")
    for value in VALUES:
        for made in (
            lambda _, value=value: value,
            lambda _, value=value: Solution(value),
            lambda p, value=value: Solution(Way(np.array([p.start, p.goal])), planning_s=value),
        ):
            message = refused(lambda made=made: plan(FLAT, planner=made))
            assert not message or "lambda" in message
        register_output("strange", lambda _, value=value: {"strange.txt": value})
        refused(lambda: api.write(planned, tmp_path / "out"))
        register_zone_reader(".strange", lambda _, value=value: value)
        with pytest.raises(InputError, match="strange"):
            load_mission({**FLAT, "no_fly": [{"file": str(file)}]})
        refused(lambda value=value: register_planner(value, len))
