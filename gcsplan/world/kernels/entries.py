"""The kernels that Python calls, with the parts of local extrema, zones and demands as separate arguments."""

from __future__ import annotations

from gcsplan.arrays import Bools, Floats, Int8s, Int64s, Singles
from gcsplan.world.kernels.compiled import DEMANDS, EXTREMA, FOUND, LEGS, ONE_SURFACE, SURFACE, WORK, ZONES, kernel
from gcsplan.world.kernels.envelope import around as around_kernel
from gcsplan.world.kernels.envelope import pieces as pieces_kernel
from gcsplan.world.kernels.judging import judge as judge_kernel
from gcsplan.world.kernels.shared import Demands, LocalExtrema, Zones


@kernel(f"{SURFACE} {EXTREMA} {EXTREMA} {EXTREMA} {ZONES} {LEGS} {DEMANDS} b1 b1[] {FOUND} {WORK}")
def judge(
    m: Floats, ground: Floats, top: Floats,
    near_slope: Singles, near_high: Singles, near_low: Singles, near_gaps: Int8s, near_cols: int, near_rows: int,
    far_slope: Singles, far_high: Singles, far_low: Singles, far_gaps: Int8s, far_cols: int, far_rows: int,
    over_slope: Singles, over_high: Singles, over_low: Singles, over_gaps: Int8s, over_cols: int, over_rows: int,
    table: Floats, vertex: Floats, lattice: Floats, bucket: Int64s, near_zones: Int64s, most_corners: int,
    start: Floats, end: Floats, column: Bools, track: Floats, altitude: Floats,
    min_agl_m: float, max_agl_m: float, max_amsl_m: float, clearance_m: float, scale: float,
    max_climb: float, max_descent: float, over_m: float,
    full: bool, ok: Bools, found: Floats, worst: Floats, nearest: Int64s, hit: Int64s, hit_at: Floats,
    stack: Floats, out: Floats, events: Floats, seen: Int64s, list_of: Int64s,
) -> int:  # fmt: skip
    """See `gcsplan.world.kernels.judging.judge`."""
    return judge_kernel(
        m, ground, top,
        LocalExtrema(near_slope, near_high, near_low, near_gaps, near_cols, near_rows),
        LocalExtrema(far_slope, far_high, far_low, far_gaps, far_cols, far_rows),
        LocalExtrema(over_slope, over_high, over_low, over_gaps, over_cols, over_rows),
        Zones(table, vertex, lattice, bucket, near_zones, most_corners),
        start, end, column, track, altitude,
        Demands(min_agl_m, max_agl_m, max_amsl_m, clearance_m, scale, max_climb, max_descent, over_m),
        full, ok, found, worst, nearest, hit, hit_at, stack, out, events, seen, list_of,
    )  # fmt: skip


@kernel(f"{SURFACE} {EXTREMA} {EXTREMA} {EXTREMA} f8[,] f8 f8 f8 f8[,]")
def pieces(
    m: Floats, ground: Floats, top: Floats,
    under_slope: Singles, under_high: Singles, under_low: Singles, under_gaps: Int8s, under_cols: int, under_rows: int,
    beside_slope: Singles, beside_high: Singles, beside_low: Singles, beside_gaps: Int8s, beside_cols: int,
    beside_rows: int,
    beyond_slope: Singles, beyond_high: Singles, beyond_low: Singles, beyond_gaps: Int8s, beyond_cols: int,
    beyond_rows: int,
    track: Floats, low_m: float, near_m: float, far_m: float, rows: Floats,
) -> int:  # fmt: skip
    """See `gcsplan.world.kernels.envelope.pieces`."""
    return pieces_kernel(
        m, ground, top,
        LocalExtrema(under_slope, under_high, under_low, under_gaps, under_cols, under_rows),
        LocalExtrema(beside_slope, beside_high, beside_low, beside_gaps, beside_cols, beside_rows),
        LocalExtrema(beyond_slope, beyond_high, beyond_low, beyond_gaps, beyond_cols, beyond_rows),
        track, low_m, near_m, far_m, rows,
    )  # fmt: skip


@kernel(f"{ONE_SURFACE} {EXTREMA} f8 f8[,] f8 f8[]")
def around(
    m: Floats, z: Floats, slope: Singles, high: Singles, low: Singles, gaps: Int8s, cols: int, rows: int,
    sign: float, points: Floats, reach_m: float, out: Floats,
) -> None:  # fmt: skip
    """See `gcsplan.world.kernels.envelope.around`."""
    around_kernel(m, z, LocalExtrema(slope, high, low, gaps, cols, rows), sign, points, reach_m, out)
