"""`python docs/_make_pictures.py`: the pictures of README and documents, made from the sample mission.

They are in `docs/pictures/`. `report.webp` is the top of the page that ``gcsplan plan --report`` writes, in Chromium.
`map.webp` is the page of ``gcsplan map`` with the same mission.
`optimal.png` is the default planner's proof: terrain above the cap, and the cells that a shorter path could meet.
Each of these holds the path's length in its description, which a test compares with a plan.
`ib-abc-wind.webp` and `msfoa-wind.webp` are charts of two papers' fleets in declared winds (`FLEETS`).
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import IO

import numpy as np
import yaml
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from PIL import ExifTags, Image

import gcsplan
from gcsplan.app.fleet.pipeline import load_mission, plan, world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.planners.optimal.navmesh.clearance import mesh_of
from gcsplan.planners.optimal.planner import search
from gcsplan.planners.problem import Problem
from tests.support import browser

TOP = Path(__file__).parents[1]
PICTURES = TOP / "docs" / "pictures"
WALL, ROOM = "#b04a3a", "#2c7fb8"
PAGE_PX, CHART_PX = 1100, 900
MAP_PX = 1100, 740
"""Width of the page in the picture; its height ends below the map's legend."""
FLEETS: dict[str, tuple[str, dict[str, object]]] = {
    "ib-abc-wind.webp": ("ib-abc-sequence", {"wind": {"up_to_m_s": 15}, "arrival": {
        "mode": "sequence", "order": ["uav1", "uav2", "uav3", "uav4"], "interval_s": 9, "window_s": 3,
        "separation_m": 20}}),
    "msfoa-wind.webp": ("msfoa-2", {"wind": {"up_to_m_s": 4}, "arrival": {
        "mode": "sequence", "order": ["uav1", "uav2", "uav3"], "interval_s": 20, "window_s": 8, "separation_m": 20}}),
}  # fmt: skip
"""The papers' fleets in docs/research/papers-wind.md: the mission of each, and the keys that differ."""


def main() -> None:
    """Write all pictures."""
    source = load_mission(TOP / "missions" / "jacksboro.yaml")
    planned = plan(source)
    problem, _ = make_problem(source, source.vehicles[0], world_of(source), source.planner.objective, 1)
    proof = io.BytesIO()
    save_proof(problem, proof)
    length = f"uav1: {planned.vehicles[0].verdict.length_m:,.0f} m"
    page = picture_of_page(gcsplan.report(planned), length)
    for name, content in (
        ("report.webp", page),
        ("map.webp", picture_of_map(length)),
        ("optimal.png", proof.getvalue()),
    ):
        (PICTURES / name).write_bytes(content)
        print(f"{PICTURES / name}: {len(content):,} bytes")
    for name, (mission, keys) in FLEETS.items():
        document = yaml.safe_load((TOP / "missions" / "papers" / f"{mission}.yaml").read_text(encoding="utf-8"))
        fleet = plan(load_mission(yaml.safe_dump(document | keys, sort_keys=False)))
        (PICTURES / name).write_bytes(picture_of_bands(gcsplan.report(fleet), arrivals(fleet)))
        print(f"{PICTURES / name}: {arrivals(fleet)}")


def arrivals(fleet: gcsplan.Plan) -> str:
    """When each vehicle of a fleet arrives in still air, and from when to when in the declared winds, s."""
    assert fleet.fleet is not None
    slots = [(v, fleet.fleet.slot(v.name)) for v in fleet.vehicles]
    rows = [(slot, v.verdict.arrive_window_s(slot) or (slot.arrive_s, slot.arrive_s)) for v, slot in slots]
    return "; ".join(f"{s.name} at {s.arrive_s:.1f} s, within {low:.1f} to {high:.1f} s" for s, (low, high) in rows)


def picture_of_bands(html: str, description: str) -> bytes:
    """A report's chart of the way flown over time, with its words, as WebP with a description."""
    with tempfile.TemporaryDirectory() as folder, browser.browser(program(), Path(folder, "home")) as shown:
        file = Path(folder, "report.html")
        file.write_text(html, encoding="utf-8")
        alone = (
            "(() => { const chart = document.querySelector('#distance'), style = chart.nextElementSibling; "
            "document.body.replaceChildren(chart, style, style.nextElementSibling); "
            "return document.body.lastChild.getBoundingClientRect().bottom })()"
        )
        shown.visit(file, width=CHART_PX)
        bottom = round(shown.evaluate(alone))
        shown.visit(file, width=CHART_PX, height=bottom + 16)
        shown.evaluate(alone)
        return webp(shown.picture(), description)


def picture_of_page(html: str, description: str) -> bytes:
    """The top of a report, down to the legend of its map, as WebP with a description."""
    with tempfile.TemporaryDirectory() as folder, browser.browser(program(), Path(folder, "home")) as shown:
        file = Path(folder, "report.html")
        file.write_text(html, encoding="utf-8")
        shown.visit(file, width=PAGE_PX)
        legend = "document.querySelector('#map + .legend').getBoundingClientRect().bottom"
        shown.visit(file, width=PAGE_PX, height=round(shown.evaluate(legend)) + 8)
        return webp(shown.picture(), description)


def picture_of_map(description: str) -> bytes:
    """The page to plan on, after the sample mission is judged with its way home, as WebP with a description."""
    from tests.page.browser_hand import Hand  # these need the extra map, and a test reads this file without it
    from tests.page.talk import serving

    with tempfile.TemporaryDirectory() as folder, browser.browser(program(), Path(folder, "home")) as shown:
        file = Path(folder, "jacksboro.yaml")
        file.write_bytes((TOP / "missions" / "jacksboro.yaml").read_bytes())
        with serving(file, Path(folder)) as server:
            shown.visit(server.url, width=MAP_PX[0], height=MAP_PX[1])
            Hand(shown).judged()
            shown.evaluate("new Promise((done) => setTimeout(done, 3000))")  # the ground's tiles
            return webp(shown.picture(), description)


def program() -> str:
    """The browser. Raises SystemExit."""
    found = browser.find()
    if found is None:
        raise SystemExit(f"needs a browser: {', '.join(browser.NAMES)}, or the one that GCSPLAN_CHROMIUM names")
    return found


def webp(png: bytes, description: str) -> bytes:
    """A picture as WebP that holds its description."""
    screen, exif = Image.open(io.BytesIO(png)).convert("RGB"), Image.Exif()
    exif[ExifTags.Base.ImageDescription] = description
    content = io.BytesIO()
    screen.save(content, "WEBP", quality=85, method=6, exif=exif)
    return content.getvalue()


def draw_proof(problem: Problem) -> Figure:
    """The plane of a problem's first leg: walls below the cap, the path, and the cells that a shorter one may meet."""
    work = search(problem)
    below, incumbent = work.plane, work.incumbent
    below.reach_longest()
    solution = incumbent.solution()
    leg = below.legs[0]
    plane = leg.plane
    walls = mesh_of(plane, below.top_m, True).piece.max(axis=1).reshape(plane.inside.shape) < 0
    room = leg.corridor(incumbent.cost)
    points = solution.path.points
    figure = Figure(figsize=(9.5, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    x, y = plane.x / 1000.0, plane.y / 1000.0
    cell_m = float(np.hypot(*np.diff(np.stack([plane.x[0, :2], plane.y[0, :2]]), axis=1).ravel()))
    ground = np.where(np.isnan(plane.grounds[0]), np.nanmin(plane.grounds[0]), plane.grounds[0])
    shade = LightSource(azdeg=315, altdeg=40).hillshade(ground[::-1], vert_exag=1.5, dx=cell_m, dy=cell_m)[::-1]
    ax.pcolormesh(x, y, shade, cmap="gray", vmin=-0.2, vmax=1.1, shading="gouraud", rasterized=True)
    fine = room.guide.mesh.plane  # the cells may be of a finer lattice
    layers = ((walls & plane.inside, plane, WALL, 0.45), (room.cells, fine, ROOM, 0.75))
    for mask, lattice, colour, alpha in layers:
        layer = np.where(mask, 1.0, np.nan)
        at = lattice.x / 1000.0, lattice.y / 1000.0
        ax.pcolormesh(*at, layer, cmap=ListedColormap([colour]), alpha=alpha, lw=0, rasterized=True)
    ax.plot(points[:, 0] / 1000.0, points[:, 1] / 1000.0, color="#111111", lw=1.8, marker=".", ms=5)
    far = 0.08 * float(np.ptp(points[:, :2], axis=0).max()) + 200.0
    low, high = (points[:, :2].min(axis=0) - far) / 1000.0, (points[:, :2].max(axis=0) + far) / 1000.0
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="east, km", ylabel="north, km")
    ax.set_aspect("equal")
    gap = 100.0 * (incumbent.cost / incumbent.bound - 1.0)
    ax.legend(
        handles=[
            Patch(fc=WALL, alpha=0.45, label=f"no path below {below.top_m:,.0f} m AMSL can be here"),
            Patch(fc=ROOM, alpha=0.75, label="a shorter path would have to stay here"),
            Line2D([], [], color="#111111", marker=".", label=f"path, {incumbent.cost:,.0f} m"),
        ],
        loc="upper right",
        fontsize=8,
    )
    ax.set_title(f"no path is shorter than {incumbent.bound:,.0f} m: gap {gap:.2f} %", loc="left", fontsize=10)
    return figure


def save_proof(problem: Problem, file: IO[bytes]) -> None:
    """Write the picture of `draw_proof` as PNG."""
    figure = draw_proof(problem)
    words = figure.axes[0].get_title(loc="left")
    figure.savefig(file, format="png", dpi=110, metadata={"Software": None, "Description": words})


if __name__ == "__main__":
    main()
