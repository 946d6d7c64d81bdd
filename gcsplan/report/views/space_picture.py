"""The view in space as a still picture: shaded terrain, zones as solids, and the tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from gcsplan.report.parts.track_samples import Line
from gcsplan.report.views.scene_data import exaggeration, zone_meshes
from gcsplan.report.views.shaded_terrain import extent_of, relief_of, shaded
from gcsplan.world.world import World

NODES = 140
TURN_DEG, TILT_DEG = -118.0, 38.0
ZONE_COLOUR = "#e0511a"


def draw(title: str, world: World, tracks: Sequence[tuple[str, str, Line]]) -> Figure | None:
    """The figure of ``tracks`` (name, colour and line of each vehicle); None if no ground is known."""
    lines = [line for _, _, line in tracks]
    relief = relief_of(world, extent_of(lines, world.airspace.zones, world.airspace.surface))
    if not np.isfinite(relief.low_m):
        return None
    extent, high = relief.extent, exaggeration(relief, lines)
    longer = max(extent.width_m, extent.height_m)
    east = np.linspace(extent.west_m, extent.east_m, max(2, round(NODES * extent.width_m / longer)))
    north = np.linspace(extent.north_m, extent.south_m, max(2, round(NODES * extent.height_m / longer)))
    ground = world.airspace.surface.ground_at(east, north[:, None])
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    assert isinstance(ax, Axes3D)
    colours = shaded(ground, east, north, relief.low_m, relief.high_m)[:-1, :-1] / 255.0
    km = 1000.0
    look = {"facecolors": colours, "shade": False, "lw": 0, "antialiased": False, "zorder": 1}
    ax.plot_surface(*np.meshgrid(east / km, north / km), ground, rstride=1, cstride=1, **look)
    top = max([relief.high_m, *(float(line.amsl_m.max()) for line in lines)])
    for mesh in zone_meshes(world.airspace.zones, world.airspace.surface, relief, lines):
        at = np.array(mesh["at"]).reshape(-1, 3)
        corners = np.column_stack([(at[:, 0] + extent.west_m) / km, (at[:, 1] + extent.south_m) / km, at[:, 2]])
        faces = corners[np.array(mesh["faces"]).reshape(-1, 3)]
        ax.add_collection3d(Poly3DCollection(faces, facecolor=ZONE_COLOUR, alpha=0.12, lw=0, zorder=2))
        label = corners[corners[:, 2].argmax()]
        top = max(top, float(label[2]))
        ax.text(*label, str(mesh["name"]), fontsize=7, color="#8f2d08", ha="center", zorder=5)
    for name, colour, line in tracks:
        ax.plot(line.east_m / km, line.north_m / km, line.amsl_m, color=colour, lw=1.8, label=name, zorder=4)
    ax.set(xlabel="east, km", ylabel="north, km", zlabel="m AMSL", zlim=(relief.low_m, max(top, relief.low_m + 1.0)))
    ax.zaxis.set_major_locator(MaxNLocator(4))
    ax.set_box_aspect((extent.width_m, extent.height_m, max(high * (top - relief.low_m), 0.02 * longer)), zoom=1.1)
    ax.view_init(elev=TILT_DEG, azim=TURN_DEG)
    ax.legend(loc="upper right", fontsize=8)
    ax.set_title(f"{title}: heights × {high:g}", loc="left")
    return figure
