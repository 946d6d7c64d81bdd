"""Traces against brute force: the least distance of two, the least height and the zones of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.sim.flight.trace import Trace, examine, meetings
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support import worlds
from tests.support.effort import draws
from tests.support.rehearsal_parts import GROUND_M


def a_trace(name: str, rng: np.random.Generator, *, stays: bool = False, spread_m: float = 300.0) -> Trace:
    """A random walk through the air over `FLAT`, in steps of about a quarter of a second."""
    n = int(rng.integers(40, 160))
    times = 20.0 * rng.random() + np.cumsum(rng.uniform(0.1, 0.4, n))
    points = np.cumsum(rng.normal(0, 2.0, (n, 3)), axis=0) + rng.uniform(-spread_m, spread_m, 3)
    points[:, 2] = GROUND_M + 60 + 0.2 * points[:, 2]
    column = np.zeros(n - 1, np.bool_)
    column[:5] = column[-7:] = True
    return Trace(name, times, points, column, np.ones(n - 1, np.intp), float(times[-1]), 0.0, np.zeros(n - 1), stays)


@settings(max_examples=draws(60))
@given(seed=st.integers(0, 2**32), count=st.integers(2, 5), stays=st.booleans())
def test_the_least_distance_is_that_of_brute_force_and_never_more(seed: int, count: int, stays: bool) -> None:
    rng = np.random.default_rng(seed)
    traces = [a_trace(f"uav{k}", rng, stays=stays and k == 0, spread_m=60.0) for k in range(count)]
    needed = 25.0
    found = [f for f in meetings(traces, needed, 0.05) if f.kind == "air"]
    least: dict[tuple[str, str], float] = {}
    horizon = max(t.end_s for t in traces)
    fine = np.arange(0.0, horizon, 0.005)
    for i, a in enumerate(traces):
        for b in traces[i + 1 :]:
            until = [horizon if t.stays else t.end_s for t in (a, b)]
            both = fine[(fine >= max(a.begin_s, b.begin_s)) & (fine <= min(until))]
            if len(both):
                least[a.name, b.name] = float(np.linalg.norm(a.at(both) - b.at(both), axis=1).min())
    near = {pair: d for pair, d in least.items() if d < needed - 1.0}
    assert near.keys() <= {f.names for f in found}
    for f in found:
        if f.names in least:  # brute force looks every 5 ms
            assert least[f.names] - 0.3 <= f.distance_m <= least[f.names] + 1e-6
    if least and found:
        assert found[0].distance_m <= min(least.values()) + 1e-6


@settings(max_examples=draws(30))
@given(seed=st.integers(0, 2**32), slack=st.sampled_from([0.0, 0.1]))
def test_the_least_height_and_every_zone_of_a_trace_are_those_of_fine_sampling(seed: int, slack: float) -> None:
    rng = np.random.default_rng(seed)
    zone = Zone("disc", Circle(0.0, 0.0, 30.0))
    world = worlds.world(lambda e, n: GROUND_M + 20 * np.sin(e / 300) * np.cos(n / 200), [zone], half_m=2000.0)
    trace = replace(a_trace("uav1", rng, spread_m=60.0), off_m=slack)
    vehicle = worlds.vehicle(min_agl_m=55.0, horizontal_clearance_m=0.0)
    judged = examine(trace, vehicle, world)
    f = np.linspace(0.0, 1.0, 41)[:-1]
    fine = trace.points[:-1, None] + f[:, None] * np.diff(trace.points, axis=0)[:, None]
    agl = fine[..., 2] - world.airspace.surface.ground_at(fine[..., 0], fine[..., 1])
    low = float(agl[~trace.column].min())
    assert low - 0.06 - 2 * slack <= judged.min_agl_m <= low + 1e-6
    found = {x.kind for x in judged.findings}
    inside = float(np.hypot(fine[..., 0], fine[..., 1]).min()) - 30.0
    if inside < -0.01:
        assert "zone" in found
    elif inside > 0.6 + slack:
        assert "zone" not in found
    if low < 55.0 - 0.01:
        assert "min_agl" in found
    elif low > 55.0 + 3.0:
        assert "min_agl" not in found
