"""The server of `gcsplan map`: time from a pointer's message to the path, from the release to verdict and plan; memory.

The page is a plain client of the WebSocket here: what a browser takes to draw is apart from it.
"""

from __future__ import annotations

import gc
import json
import math
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gcsplan.bench.measure import percentile, resident_mb
from gcsplan.bench.sample import SAMPLE_HALF_M, SAMPLE_MIDDLE_DEG, SAMPLE_TERRAIN
from gcsplan.bench.session import SESSION_ZONES, degree_terrain, drawn_mission
from gcsplan.units import METRIC
from gcsplan.world.geodesy.frame import Frame

DRAG_PLACES = 50
"""Places over which one drag leads the goal."""

DRAG_STEP_M = 60.0
"""Metres between two of them: some pixels of the map, as a pointer moves."""

MANY_ZONES = 200
PAGE_ANSWER_S = 60.0
GOAL = "vehicles[0].goal"


def run(
    drags: int = 8, moves: int = 0, seed: int = 1, *, degree: bool = True, places: int = DRAG_PLACES
) -> dict[str, Any]:
    """Measure ``drags`` of the goal over ``places`` on the sample with few and many zones and on a tile of one degree,
    and the memory that ``moves`` take (0: not measured)."""
    result: dict[str, Any] = {"drags": drags, "places": places, "seed": seed}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for zones in (SESSION_ZONES, MANY_ZONES):
            rng = np.random.default_rng(seed)
            mission = drawn_mission(SAMPLE_TERRAIN, SAMPLE_MIDDLE_DEG, SAMPLE_HALF_M, rng, zones)
            with _page(mission, folder) as page:
                result[f"zones_{zones}"] = _measured(page, SAMPLE_MIDDLE_DEG, drags, rng, places)
        if degree:
            rng = np.random.default_rng(seed)
            middle = (46.5, 8.5)
            mission = drawn_mission(_written(degree_terrain(rng), folder), middle, (20_000.0, 20_000.0), rng)
            with _page(mission, folder) as page:
                result["degree"] = _measured(page, middle, drags, rng, places)
        if moves:
            rng = np.random.default_rng(seed)
            mission = drawn_mission(SAMPLE_TERRAIN, SAMPLE_MIDDLE_DEG, SAMPLE_HALF_M, rng)
            with _page(mission, folder) as page:
                result["memory"] = _memory(page, SAMPLE_MIDDLE_DEG, moves, rng)
    return result


def report(result: dict[str, Any]) -> str:
    """The figures in lines."""
    lines = []
    for key in (f"zones_{SESSION_ZONES}", f"zones_{MANY_ZONES}", "degree"):
        if key in result:
            one = result[key]
            counts = f"{one['paths']} paths, {one['refused']} refused, {one['plans']} plans"
            path, first, plan = (_in_words(one, name) for name in ("path", "verdict", "plan"))
            words = f"pointer to path {path}; release to verdict {first}; to the whole plan {plan}; {counts}"
            lines.append(f"{key.replace('_', ' ')}: {words}")
    if "memory" in result:
        memory = result["memory"]
        grown = f"{memory['grown_bytes'] / 1e3:+.0f} kB of Python's"
        lines.append(
            f"memory: {grown}, resident {memory['resident_grown_bytes'] / 1e6:+.1f} MB in {memory['moves']} moves"
        )
    return "\n".join(lines)


def _in_words(one: dict[str, Any], name: str) -> str:
    clock, processor = ([one[f"{name}_p{q}{end}"] for q in (50, 90)] for end in ("_ms", "_processor_ms"))
    if clock[0] is None:
        return "not measured"
    return f"p50 {clock[0]:.0f}, p90 {clock[1]:.0f} ms (processor {processor[0]:.0f}, {processor[1]:.0f} ms)"


class _Client:
    """One page: sends messages, and waits for answers to the newest one."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._n = socket, 0

    def ask(self, kind: str, *until: str, **more: Any) -> dict[str, Any]:
        """Send a message; the first answer to it of one of the kinds ``until``."""
        self._n += 1
        self._socket.send(json.dumps({"type": kind, "n": self._n, **more}))
        return self.until(*until)

    def until(self, *until: str) -> dict[str, Any]:
        """The next answer to the newest message of one of the kinds ``until``."""
        while True:
            answer: dict[str, Any] = json.loads(self._socket.recv(timeout=PAGE_ANSWER_S))
            if answer["type"] in until and answer["n"] == self._n:
                return answer


@contextmanager
def _page(mission: dict[str, Any], folder: Path) -> Iterator[_Client]:
    """A server of the mission, and a page that has its first certificate."""
    from websockets.sync.client import connect

    from gcsplan.page.edits import Edits
    from gcsplan.page.map_session import MapSession
    from gcsplan.page.server import HOST, MapServer
    from gcsplan.page.steps.flight_steps import PageSteps

    file = Path(tempfile.mkdtemp(dir=folder)) / "bench.yaml"  # edits that are kept are of this mission alone
    file.write_text(yaml.safe_dump(mission), encoding="utf-8")
    session = MapSession(Edits.of_file(file), METRIC, PageSteps)
    server = MapServer(session)
    server.start()
    origin = {"Origin": f"http://{HOST}:{server.port}"}
    url = server.url.replace("http://", "ws://") + "socket"
    try:
        with connect(url, additional_headers=origin, compression=None, max_size=None, proxy=None) as socket:
            page = _Client(socket)
            page.ask("hello", "plan", "refused", "error")
            yield page
    finally:
        server.stop()
        session.close()


def _drag(middle: tuple[float, float], rng: np.random.Generator, places: int) -> list[list[float]]:
    """Places of the goal along a bent line around the middle."""
    frame, turn, far_m = Frame(*middle), rng.uniform(0.0, 2.0 * math.pi), rng.uniform(3_000.0, 9_000.0)
    angles = turn + np.arange(places) * DRAG_STEP_M / far_m
    degrees = frame.to_degrees(far_m * np.cos(angles), far_m * np.sin(angles))
    return [[round(float(lat), 6), round(float(lon), 6)] for lat, lon in degrees]


def _measured(
    page: _Client, middle: tuple[float, float], drags: int, rng: np.random.Generator, count: int
) -> dict[str, Any]:
    """Milliseconds over the socket, from each place to its path, and from each release to the first verdict and to the
    plan: by the clock, and of the processor, which server and page together take."""
    paths, verdicts, plans, refused = _Times(), _Times(), _Times(), 0
    for drag in range(drags + 1):
        places = _drag(middle, rng, count)
        for place in places:
            paths.begin()
            answer = page.ask("change", "path", "refused", "error", changes={GOAL: place}, live=True)
            refused += answer["type"] != "path"
            if answer["type"] == "path" and drag:  # the first drag warms up
                paths.end()
        plans.begin()
        verdicts.begin()
        answer = page.ask("change", "interim", "plan", "refused", "error", changes={GOAL: places[-1]})
        if answer["type"] in ("interim", "plan") and drag:
            verdicts.end()
        if answer["type"] == "interim":
            answer = page.until("plan", "refused", "error")
        if answer["type"] == "plan" and drag:
            plans.end()
        page.ask("units", "home", "refused", "error", units="metric")
    return {
        "paths": len(paths.clock_ms), "refused": refused, "plans": len(plans.clock_ms), **paths.quantiles("path"),
        **verdicts.quantiles("verdict"), **plans.quantiles("plan"),
    }  # fmt: skip


class _Times:
    """Milliseconds of many answers, by the clock and of the processor."""

    def __init__(self) -> None:
        self.clock_ms: list[float] = []
        self.processor_ms: list[float] = []
        self.begin()

    def begin(self) -> None:
        self._clock_s, self._processor_s = time.perf_counter(), time.process_time()

    def end(self) -> None:
        self.clock_ms.append((time.perf_counter() - self._clock_s) * 1e3)
        self.processor_ms.append((time.process_time() - self._processor_s) * 1e3)

    def quantiles(self, name: str) -> dict[str, float | None]:
        """The median, and the value that one in ten is above; None without answers."""
        return {
            f"{name}_p{q}{end}": percentile(times, q)
            for end, times in (("_ms", self.clock_ms), ("_processor_ms", self.processor_ms))
            for q in (50, 90)
        }


def _memory(page: _Client, middle: tuple[float, float], moves: int, rng: np.random.Generator) -> dict[str, Any]:
    """Bytes that the server holds more after many moves than after the first hundred."""

    def move(count: int) -> None:
        for k, place in enumerate(_drag(middle, rng, count)):
            page.ask(
                "change", "path", "refused", "error", "plan", changes={GOAL: place}, live=bool((k + 1) % DRAG_PLACES)
            )

    tracemalloc.start()
    move(2 * DRAG_PLACES)  # with all that is kept from one plan to the next
    gc.collect()
    before, resident = tracemalloc.get_traced_memory()[0], resident_mb()
    move(moves)
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return {"moves": moves, "grown_bytes": grown, "resident_grown_bytes": (resident_mb() - resident) * 2**20}


def _written(terrain: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The terrain as a file of the folder, as a mission file names it."""
    import rasterio
    from rasterio.transform import Affine

    heights, (a, b, c, d, e, f) = terrain["dem"], terrain["transform"]
    with rasterio.open(
        folder / "degree.tif", "w", driver="GTiff", width=heights.shape[1], height=heights.shape[0], count=1,
        dtype="float32", crs=terrain["crs"], transform=Affine(a, b, c, d, e, f), tiled=True,
    ) as file:  # fmt: skip
        file.write(heights, 1)
    return {"dem": str(folder / "degree.tif"), "vertical_datum": terrain["vertical_datum"]}
