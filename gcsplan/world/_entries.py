"""The kernels that Python calls, with the parts of local extrema, zones and demands as separate arguments."""

from __future__ import annotations

from gcsplan.world._envelope import around as around_kernel
from gcsplan.world._envelope import pieces as pieces_kernel
from gcsplan.world._extrema import local_extrema as local_extrema_kernel
from gcsplan.world._judge import judge as judge_kernel
from gcsplan.world._shared import Demands, LocalExtrema, Zones
from gcsplan.world._sweep import device


@device
def judge(  # type: ignore[no-untyped-def]
    m, ground, top,
    near_slope, near_high, near_low, near_cols, near_rows,
    far_slope, far_high, far_low, far_cols, far_rows,
    over_slope, over_high, over_low, over_cols, over_rows,
    table, vertex, lattice, bucket, near_zones, most_corners,
    start, end, column, track, altitude,
    min_agl_m, max_agl_m, max_amsl_m, clearance_m, scale, max_climb, max_descent,
    full, ok, found, worst, nearest, hit, hit_at, stack, out, events, seen, list_of,
):  # fmt: skip
    """See `gcsplan.world._judge.judge`."""
    return judge_kernel(
        m, ground, top,
        LocalExtrema(near_slope, near_high, near_low, near_cols, near_rows),
        LocalExtrema(far_slope, far_high, far_low, far_cols, far_rows),
        LocalExtrema(over_slope, over_high, over_low, over_cols, over_rows),
        Zones(table, vertex, lattice, bucket, near_zones, most_corners),
        start, end, column, track, altitude,
        Demands(min_agl_m, max_agl_m, max_amsl_m, clearance_m, scale, max_climb, max_descent),
        full, ok, found, worst, nearest, hit, hit_at, stack, out, events, seen, list_of,
    )  # fmt: skip


@device
def pieces(  # type: ignore[no-untyped-def]
    m, ground, top,
    under_slope, under_high, under_low, under_cols, under_rows,
    beside_slope, beside_high, beside_low, beside_cols, beside_rows,
    beyond_slope, beyond_high, beyond_low, beyond_cols, beyond_rows,
    track, low_m, near_m, far_m, rows,
):  # fmt: skip
    """See `gcsplan.world._envelope.pieces`."""
    return pieces_kernel(
        m, ground, top,
        LocalExtrema(under_slope, under_high, under_low, under_cols, under_rows),
        LocalExtrema(beside_slope, beside_high, beside_low, beside_cols, beside_rows),
        LocalExtrema(beyond_slope, beyond_high, beyond_low, beyond_cols, beyond_rows),
        track, low_m, near_m, far_m, rows,
    )  # fmt: skip


@device
def around(m, z, slope, high, low, cols, rows, sign, points, reach_m, out):  # type: ignore[no-untyped-def]
    """See `gcsplan.world._envelope.around`."""
    around_kernel(m, z, LocalExtrema(slope, high, low, cols, rows), sign, points, reach_m, out)


@device
def local_extrema(z, step_x, step_y, cols, rows, box, room, slope, high, low):  # type: ignore[no-untyped-def]
    """See `gcsplan.world._extrema.local_extrema`."""
    return local_extrema_kernel(z, step_x, step_y, cols, rows, box, room, slope, high, low)
