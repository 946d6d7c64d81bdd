"""Terrain over a link in simulated time: a vehicle asks as ArduPilot does, and reads what it was sent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.arrays import Floats
from gcsplan.errors import InputError, VehicleRefused
from gcsplan.mavlink.link.frames import FrameWriter, Signing
from gcsplan.mavlink.link.link import Link, LinkSteps, PumpJob, pump
from gcsplan.mavlink.link.session.results import UploadResult
from gcsplan.mavlink.link.session.session import SessionOptions, upload_mission
from gcsplan.mavlink.link.terrain import (
    OFF,
    TerrainComparison,
    TerrainService,
    compare_steps,
    places_along,
    terrain_error_m,
)
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import RELATIVE, TERRAIN, Home, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.notes.note import Note
from gcsplan.sim.vehicle.hub import Hub
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.vehicle import Autopilot
from gcsplan.world.terrain.grid import GroundHeights
from tests.campaigns.air import Air, Radio

AT = (36.59, -84.25)
VEHICLE = Address(1, 1)


def hills(lat_deg: Floats, lon_deg: Floats) -> Floats:
    return np.asarray(400.0 + 60.0 * np.sin(lat_deg * 900.0) * np.cos(lon_deg * 700.0))


def air_with_vehicle(radio: Radio | None = None, *, seed: int = 1, spacing_m: int = 100) -> Air:
    air = Air(seed, radio or Radio(), limit_s=900.0)
    vehicle = LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=AT[0], lon_deg=AT[1], amsl_m=400.0, parameters={"TERRAIN_SPACING": spacing_m}
    )
    air.put("vehicle", Hub([vehicle], always="ground station"))
    return air


def wait_steps(link: Link, seconds: float) -> LinkSteps[None]:
    end = link.clock() + seconds
    while link.clock() < end:
        yield min(end, link.clock() + 1.0)


def serve_for(link: Link, seconds: float) -> None:
    channel = link.channel(1)
    job = PumpJob(channel, wait_steps(link, seconds))
    pump([job])
    assert job.error is None


def compared(
    link: Link, service: TerrainService, places: list[tuple[int, int]], spacing_m: int = 100
) -> TerrainComparison:
    channel = link.channel(1)
    posts = service.posts(spacing_m)
    job = PumpJob(channel, compare_steps(channel, VEHICLE, places, posts, patience_s=20.0))
    pump([job])
    assert job.error is None
    assert job.result is not None
    return job.result


def places(count: int, reach_deg: float = 0.06) -> list[tuple[int, int]]:
    rng = np.random.default_rng(3)
    lat = rng.uniform(AT[0] - reach_deg, AT[0] + reach_deg, count) * 1e7
    lon = rng.uniform(AT[1] - reach_deg, AT[1] + reach_deg, count) * 1e7
    return list(zip(lat.astype(int).tolist(), lon.astype(int).tolist(), strict=True))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("loss", "spacing_m"),
    [(0.0, 100), pytest.param(0.2, 100, marks=pytest.mark.slow), pytest.param(0.0, 30, marks=pytest.mark.slow)],
)
def test_a_vehicle_gets_all_that_it_asks_for(loss: float, spacing_m: int) -> None:
    air = air_with_vehicle(Radio(loss=loss), spacing_m=spacing_m)
    service = TerrainService(hills)
    with air.link() as link:
        link.serve(1, service.steps)
        serve_for(link, 75.0 if loss else 45.0)
        served = service.served[1]
        assert served.requests >= 4
        assert len(served.blocks) >= 4
        assert served.notes == []
        [hub] = air.at("vehicle")
        [(_, telemetry, _)] = hub.vehicles  # type: ignore[attr-defined]
        assert telemetry.terrain.pending == 0
        assert telemetry.terrain.loaded == 56 * len(served.blocks)


@pytest.mark.slow
def test_what_it_reads_is_what_was_sent() -> None:
    air = air_with_vehicle()
    service = TerrainService(hills)
    with air.link() as link:
        link.serve(1, service.steps)
        result = compared(link, service, [*places(9), places(1)[0]])
    assert result.read == 10
    assert result.worst_m < 0.001
    assert result.worst_at is not None


@pytest.mark.nightly
def test_other_terrain_on_board_is_seen() -> None:
    air = air_with_vehicle()
    with air.link() as link:
        link.serve(1, TerrainService(lambda a, o: hills(a, o) + 7.0).steps)
        result = compared(link, TerrainService(hills), places(20, 0.01))
    assert result.read == 20
    assert result.worst_m == pytest.approx(7.0, abs=0.001)


@pytest.mark.nightly
def test_unknown_ground_is_not_sent_and_told() -> None:
    def half(lat_deg: Floats, lon_deg: Floats) -> Floats:
        return np.where(lat_deg > AT[0], np.nan, 300.0)

    air = air_with_vehicle()
    service = TerrainService(half)
    with air.link() as link:
        link.serve(1, service.steps)
        result = compared(link, service, places(8, 0.01))
    assert np.isnan(result.off_m[[a > AT[0] * 1e7 for a, _ in result.places_e7]]).all()
    # A block that is never complete keeps the vehicle from asking for those after it in its cache.
    assert 1 <= result.read < 8
    assert result.worst_m < 0.001
    [note] = service.served[1].notes
    assert note.code == "terrain_parts_not_sent"
    assert result.pending > 0


def test_terrain_that_cannot_be_loaded_is_told_and_the_link_goes_on() -> None:
    def broken(lat_deg: Floats, lon_deg: Floats) -> Floats:
        raise InputError("the tile is damaged")

    air = air_with_vehicle()
    service = TerrainService(broken)
    with air.link() as link:
        link.serve(1, service.steps)
        serve_for(link, 20.0)
    assert service.served[1].parts == 0
    assert service.served[1].notes == [Note("terrain_not_loaded", why="the tile is damaged")]


@pytest.mark.slow
def test_strange_requests_are_counted_and_what_waits_is_bounded() -> None:
    air = air_with_vehicle()
    service = TerrainService(hills)
    writer = FrameWriter(VEHICLE, Signing())
    mask = (1 << 56) - 1
    with air.link() as link:
        link.serve(1, service.steps)
        grid = service.posts(100).grid
        for block in islice(grid.blocks_within(365e6, -845e6, 368e6, -841e6), 90):
            request = dialect.MAVLink_terrain_request_message(*grid.corner_e7(block), 100, mask)
            air.say("vehicle", writer.pack(request), "vehicle")
        for lat, lon, spacing in ((365_000_123, -844_000_000, 100), (365_000_000, -844_000_000, 0)):
            request = dialect.MAVLink_terrain_request_message(lat, lon, spacing, mask)
            air.say("vehicle", writer.pack(request), "vehicle")
        air.say(
            "vehicle",
            writer.pack(dialect.MAVLink_terrain_request_message(365_000_000, -900_000_000, 2**16 - 1, 0)),
            "v",
        )
        serve_for(link, 30.0)
    served = service.served[1]
    assert served.strange == 3
    assert served.requests >= 75
    assert served.parts <= 64 * 56 + 20 * 56


@pytest.mark.nightly
def test_the_vehicle_is_asked_for_its_requests_only_if_it_does_not_send_them() -> None:
    air = air_with_vehicle()
    asked: list[int] = []
    with air.link() as link:
        sent = link.send

        def watched(message: object, *more: object) -> bool:
            if type(message).__name__ == "MAVLink_command_long_message":
                asked.append(int(message.param1))  # type: ignore[attr-defined]
            return sent(message, *more)  # type: ignore[arg-type]

        link.send = watched  # type: ignore[method-assign]
        link.serve(1, TerrainService(hills).steps)
        serve_for(link, 12.0)
    assert asked == [133, 136]


def mission() -> Mission:
    """Two legs in the terrain frame beside the vehicle."""
    at = [(round((AT[0] + d) * 1e7), round((AT[1] + d) * 1e7)) for d in (0.0, 0.004, 0.008)]
    items = [MissionItem(cmd.TAKEOFF, RELATIVE, x=at[0][0], y=at[0][1], z=100.0)]
    items += [MissionItem(cmd.WAYPOINT, TERRAIN, x=a, y=o, z=100.0) for a, o in at[1:]]
    return Mission(Autopilot.ARDUCOPTER, Home.at(*AT, 400.0), tuple(items), "uav1", 1)


def uploaded(air: Air, ground: GroundHeights | None, **more: object) -> tuple[UploadResult, dict[str, float]]:
    """The result of an upload, and the values that it was judged with."""
    told: dict[str, float] = {}

    def judge(_: Mission, values: Mapping[str, float]) -> None:
        told.update(values)

    options = SessionOptions(unchecked=True, terrain=ground, **more)  # type: ignore[arg-type]
    with air.link() as link:
        return upload_mission(link, mission(), options=options, judge=judge), told


@pytest.mark.nightly
def test_an_upload_serves_the_terrain_and_measures_what_the_vehicle_reads() -> None:
    result, values = uploaded(air_with_vehicle(), hills)
    assert result.outcome == "accepted"
    assert values["TERRAIN_OFS_MAX"] == 30.0
    assert values[OFF] < 0.001
    assert not any("terrain" in warning.code for warning in result.warnings)
    assert terrain_error_m(values, 30.0) == pytest.approx(30.0, abs=0.001)


@pytest.mark.nightly
def test_an_upload_goes_on_without_terrain_and_says_so() -> None:
    result, values = uploaded(air_with_vehicle(), lambda a, o: np.full(np.shape(a), np.nan))
    assert result.outcome == "accepted"
    assert OFF not in values
    assert Note("terrain_incomplete_on_board", lacking=40, places=40) in result.warnings


def test_a_vehicle_without_terrain_is_told() -> None:
    air = Air(1, Radio(), limit_s=900.0)
    one = LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=AT[0], lon_deg=AT[1], amsl_m=400.0, parameters={"TERRAIN_ENABLE": 0}
    )
    air.put("vehicle", Hub([one], always="ground station"))
    result, values = uploaded(air, hills)
    assert Note("terrain_off_on_board") in result.warnings
    assert OFF not in values


@pytest.mark.parametrize("spacing", [2, 4, 1001])
def test_posts_that_are_not_judged_are_refused_at_once(spacing: int) -> None:
    with pytest.raises(VehicleRefused, match=f"TERRAIN_SPACING is {spacing} on board, and 5 to 1000 m are judged"):
        uploaded(air_with_vehicle(spacing_m=spacing), hills)


def test_the_error_is_what_the_vehicle_may_shift_and_what_it_reads_amiss() -> None:
    assert terrain_error_m({}, 30.0) == 30.0
    assert terrain_error_m({"TERRAIN_OFS_MAX": 5.0, OFF: 0.25}, 30.0) == 5.25
    assert terrain_error_m({"TERRAIN_OFS_MAX": 50.0, OFF: 0.25}, 30.0) == 50.25
    # What was not measured makes nothing better.
    assert terrain_error_m({"TERRAIN_OFS_MAX": 5.0}, 30.0) == 30.0
    assert terrain_error_m({"TERRAIN_OFS_MAX": 50.0}, 30.0) == 50.0
    assert terrain_error_m({OFF: 44.0}, 30.0) == 44.0


def test_places_lie_on_the_legs_in_the_terrain_frame_alone() -> None:
    items = mission().items
    assert len(places_along(items)) == 40
    assert places_along(items)[0] == (items[1].x, items[1].y)
    assert places_along([replace(i, frame=RELATIVE) for i in items]) == []
    many = [replace(items[1], x=items[1].x + 1000 * k) for k in range(650)]
    assert len(places_along([items[0], *many])) <= 40
    across = [replace(items[1], y=y) for y in (1_799_000_000, -1_799_000_000)]
    assert all(abs(lon) > 1_798_999_999 for _, lon in places_along(across))
