"""What a stranger's script hands in: each value in each place is taken, or refused by gcsplan with its place.

The values lie, raise, hold themselves, or are of types that no mission has; none may meet a TypeError from inside.
"""

from __future__ import annotations

import collections
import copy
import datetime
import decimal
import fractions
import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gcsplan
from gcsplan.app import api
from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.session import Planner
from gcsplan.errors import GcsplanError, InputError, UsageError
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.planners.problem import Refusal, Solution
from gcsplan.plugins import (
    OPTIMISERS_ADDED,
    OUTPUTS,
    PLANNERS,
    ZONE_READERS,
    register_output,
    register_planner,
    register_zone_reader,
)
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
    for added in (OPTIMISERS_ADDED, PLANNERS, OUTPUTS, ZONE_READERS):
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


MORE: list[Any] = [
    10**30, "", "36.6,-84.3\udcff", b"\xff" * 9, np.float32("nan"), np.int64(3), np.bool_(True), np.array(3.0),
    np.array([1, 2]), np.array("x"), [[]], (), {"a": np.nan}, frozenset(), datetime.datetime(1, 1, 1), "." * 5000,
    datetime.date(2026, 1, 1), iter([1]), (x for x in "a"), Exception, lambda: 0, 2**63, ["\ud800"], {"\ud800": 1},
    np.zeros((2, 2, 2)), np.zeros((0, 3)), bytearray(b"x"), memoryview(b"x"), complex("nan"), np.datetime64("NaT", "s"),
]  # fmt: skip

NOBODY = "uav1=udpout:127.0.0.1:9"
LEFT_ALONE = {"progress", "on_path", "on_bound", "function", "cluster", "offline"}
"""What a function raises that gcsplan calls, or an executor of the caller's own, is its own; tests use no network."""
MADE_HERE = {
    "BetterPath", "FleetPlan", "Finding", "JobResult", "LegFigures", "Mission", "MissionFile", "Plan", "Problem",
    "Progress", "Rehearsal", "Solution", "VehiclePlan", "Verdict", "Via",
}  # fmt: skip
"""Records: types that gcsplan fills, or takes over without a look until a planner's result is judged."""


def usual(planned: Plan, folder: Path) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Each public name with arguments that it takes, methods of a session and of results included."""
    vehicle, session = planned.vehicles[0], Planner(FLAT)
    unheard = {"timeout_s": 0.01, "allow_parameters": False}
    calls: dict[str, dict[str, Any]] = {
        "check": {"what": vehicle.mission, "within": planned}, "write": {"planned": planned, "folder": folder},
        "report": {"planned": planned, "way_home": False}, "upload": {"planned": planned, "to": NOBODY, **unheard},
        "verify": {"file": folder / "uav1.plan", "url": NOBODY[5:], **unheard}, "rehearse": {"planned": planned},
        "download": {"url": NOBODY[5:], "timeout_s": 0.01}, "clear": {"url": NOBODY[5:], "timeout_s": 0.01},
        "new": {"start": "36.6,-84.3", "goal": "36.61,-84.3", "flat_m": 300.0}, "load_mission": {"source": FLAT},
        "fetch_dem": {"around": "36.6,-84.3", "radius_km": 1.0, "offline": True}, "plan": {"source": planned.source},
        "Planner": {"mission": FLAT}, "Path": {"points": [[0, 0, 0], [1, 0, 0]]},
        "MissionItem": {"command": 16, "frame": 3},
        **{f"register_{what}": {"name": "x", "function": len} for what in ("planner", "optimiser", "output")},
        "register_zone_reader": {"ending": ".x", "function": len},
    }  # fmt: skip
    public = {name: getattr(gcsplan, name) for name in gcsplan.__all__ if name not in MADE_HERE | {"__version__"}}
    errors = {name for name, one in public.items() if isinstance(one, type) and issubclass(one, GcsplanError)}
    # What is registered stays, so that comes last.
    looked_at = sorted(public.keys() - errors, key=lambda name: (name.startswith("register"), name))
    found = {name: (public[name], calls[name]) for name in looked_at}
    methods = {"change": {"changes": {}}, "restore": {"mission": FLAT}, "plan": {}, "loaded": {}, "cancel": {}}
    return found | {f"Planner.{name}": (getattr(session, name), given) for name, given in methods.items()}


@pytest.mark.nightly
@pytest.mark.usefixtures("nothing_added")
def test_no_public_function_lets_another_error_through(
    planned: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, (function, given) in usual(planned, tmp_path / "out").items():
        for argument in inspect.signature(function).parameters.keys() - LEFT_ALONE:
            for value in (*VALUES, *MORE):
                try:
                    refused(lambda f=function, all_of={**given, argument: value}: f(**all_of))
                except Exception as why:
                    pytest.fail(f"{name}({argument}={type(value).__name__}) raises {type(why).__name__}: {why}")


def test_records_that_planners_and_scripts_make_refuse_what_they_cannot_be() -> None:
    for made in (
        lambda: Way([[0, 0]]), lambda: Way("x"), lambda: Refusal("x", reason="not_found", place=7),
        lambda: Refusal("x", reason="not_found", place=(1.0, 2.0, 3.0)), lambda: MissionItem(16, 3, x=1.5),
        lambda: MissionItem("16", 3), lambda: MissionItem(16, 3, params=(0.0, 0.0, 0.0)),
    ):  # fmt: skip
        assert refused(made)
    assert Refusal("x", reason="not_found", place=(1.0, np.float64(2.0))).north_m == 2.0


@pytest.mark.slow
def test_a_vehicle_that_a_fleet_does_not_have_is_refused_by_name(planned: Plan) -> None:
    assert planned.fleet is not None
    for look in (planned.fleet.slot, planned.fleet.motion):
        with pytest.raises(InputError, match=r"takes the name of a vehicle, given 'uav9'"):
            look("uav9")
        with pytest.raises(UsageError, match=r"name is the name of a vehicle; given int 7"):
            look(7)  # type: ignore[arg-type]
