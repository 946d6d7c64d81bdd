"""The view in space: its figure, and the data that it shares with the map's pointer and the replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.figures import steepened
from gcsplan.report.parts.html import esc, num, tools
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.report.parts.track_samples import TrackLine, line_of
from gcsplan.report.views.replay import Replay, replay_data, replay_of
from gcsplan.report.views.scene_data import exaggeration, zone_meshes
from gcsplan.report.views.shaded_terrain import Relief, extent_of, relief_of
from gcsplan.world.geometry.zones import no_fly_of
from gcsplan.world.world import World


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a page draws: the line of each subject (None: there is nothing to follow), the ground below, the replay."""

    lines: tuple[TrackLine | None, ...]
    relief: Relief
    replay: Replay | None


def drawn(page: Page, samples: Sequence[int]) -> Drawing:
    """The lines of a page's subjects, each with about as many ``samples`` as given for it, and the ground around."""
    lines = tuple(
        line_of(s.verdict, page.world, s.vehicle.limits, samples=many, slot=s.slot)
        for s, many in zip(page.subjects, samples, strict=True)
    )
    airspace = page.world.airspace
    extent = extent_of([line for line in lines if line is not None], no_fly_of(airspace.zones), airspace.surface)
    return Drawing(lines, relief_of(page.world, extent, page.units.height), replay_of(page))


def space_data(page: Page, seen: Drawing) -> dict[str, object]:
    """The ground, the lines, the zones and the replay for the page's script."""
    there, relief, airspace = [line for line in seen.lines if line is not None], seen.relief, page.world.airspace
    return {
        "grid": relief.grid,
        "lines": [
            _line_data(i, s, line) | {"broken": _broken(s, page.world)}
            for i, (s, line) in enumerate(zip(page.subjects, seen.lines, strict=True))
            if line is not None
        ],
        "zones": zone_meshes(no_fly_of(airspace.zones), airspace.surface, relief, there),
        "exaggeration": exaggeration(relief, there),
        "replay": replay_data(seen.replay, page) if seen.replay else None,
    }  # fmt: skip


def space_html(page: Page, relief: Relief) -> str:
    """The figure and its controls; empty where no ground is known."""
    if not math.isfinite(relief.low_m):
        return ""
    return (
        f'<section id="space"><h2>In space</h2>{tools("scene")}<figure class="view scene" id="scene"><canvas '
        f'role="img" tabindex="0" aria-label="{esc(page.title)} in space: ground, no-fly zones and tracks; the map and '
        'the profiles show the same"></canvas><canvas class="over" aria-hidden="true"></canvas>'
        '<p class="nothing">This view needs a browser that runs scripts.</p></figure>'
        '<label class="stretch" hidden>heights × <input type="range" min="1" max="8" step="0.5"> '
        "<output></output></label>"
        f'<p class="note">Drag to turn, two fingers or the right button to move. The ground is drawn every '
        f"{num(relief.cell_m, 0 if relief.cell_m >= 10 else 1, page.units.distance)}: do not read clearances off this "
        "view.</p>"
        "</section>"
    )


def _broken(subject: Subject, world: World) -> list[list[object]]:
    """East, north, AMSL and kind of every finding that has a place."""
    found: list[list[object]] = []
    for f in subject.verdict.findings:
        if math.isfinite(f.lat_deg + f.lon_deg + f.amsl_m):
            e, n = (round(float(v), 1) for v in world.frame.to_plane(f.lat_deg, f.lon_deg))
            found.append([e, n, round(f.amsl_m, 1), f.kind.replace("_", " ")])
    return found


def _line_data(index: int, subject: Subject, line: TrackLine) -> dict[str, object]:
    """One line for the page's script, rounded to decimetres (a short one to millimetres), which is enough to view."""
    legs = subject.verdict.legs

    decimals = 1 if line.length_m > 1000.0 else 3

    def rounded(values: object) -> list[float | None]:
        return [round(float(v), decimals) if math.isfinite(v) else None for v in np.asarray(values, float)]

    return {
        "index": index, "name": subject.name,
        "s": rounded(line.run_m), "e": rounded(line.east_m), "n": rounded(line.north_m),
        "z": rounded(line.amsl_m), "g": rounded(line.ground_m),
        "o": rounded(line.top_m) if not np.array_equal(line.top_m, line.ground_m, equal_nan=True) else None,
        "f": rounded(line.floor_m), "c": rounded(line.ceiling_m), "t": rounded(line.time_s), "leg": line.leg.tolist(),
        "j": [round(float(j) / 1000.0, 1) for j in line.used_j] if subject.verdict.energy_stated else None,
        "legs": [
            {"seq": leg.seq, "kind": leg.kind, "column": leg.column, "climb": steepened(leg.climb_deg, 1)}
            for leg in legs
        ],
        "ends": np.flatnonzero(line.end).tolist(),
        "battery": subject.vehicle.energy.battery_j and round(subject.vehicle.energy.battery_j / 1000.0, 1),
        "volts": subject.vehicle.energy.battery_v,
    }  # fmt: skip
