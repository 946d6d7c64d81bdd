"""Undeclared voids, which a terrain model holds as heights of exactly 0.

Programs fill unknown cells with 0, and such a hole on a crest looks like a valley. Sea and lakes at 0 have a
shore: ground that rises from 0. A patch of exact zeros without any shore has cliffs all around, and counts as a void.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.terrain.mosaic import Window
from gcsplan.world.terrain.raster import MAX_CELLS

SHORE_M = 5.0
"""Ground within this of 0, m, beside a patch of zeros is its shore."""


class Patch(NamedTuple):
    """A patch of exact zeros: its nodes, its first one, and how far from 0 the nearest ground beside it is, m."""

    nodes: int
    row: int
    col: int
    beside_m: float


NodeDegrees = Callable[[Sequence[int], Sequence[int]], tuple[Floats, Floats]]
"""Latitudes and longitudes of columns and rows of nodes, as `Mosaic.node_degrees` gives them."""


def take_out_zeros(
    window: Window, degrees: NodeDegrees, wider: Iterable[Window] = (), *, where: str = ""
) -> list[Note]:
    """Make the patches of exact zeros that have no shore unknown, in place; returns a note that names them.

    ``wider``: larger windows of the same files, from small to large, that are looked at where a patch fills the window
    to its border. ``where`` names the files in messages. Raises InputError if the patches of so large a window do not
    fit into memory.
    """
    surfaces = [z for z in (window.heights_m, window.low_m) if z is not None]
    cells = sum(z.size for z in surfaces)
    if cells > MAX_CELLS // 2 and any((z == 0.0).any() for z in surfaces):
        raise InputError(
            f"the DEM has heights of exactly 0 m, which may hide voids, and is too large around the mission to look "
            f"at their shores: {cells / 1e6:.3g} million cells, more than {MAX_CELLS // 2 / 1e6:.3g} million. If each "
            f"0 is ground or sea, state `nodata: none`, and if each is a void `nodata: 0`; or use a coarser DEM "
            f"(gdalwarp -tr)",
            where=where,
        )
    found = [zero_voids(z) for z in surfaces]
    blind = found[0].blind
    notes: list[Note] = []
    if blind.any():
        beyond, notes = _looked_beyond(window, blind, wider)
        found += beyond
    for void in found:
        for z in surfaces:
            z[void.nodes] = np.nan
    patches = next((void.patches for void in found if void.patches), None)
    if patches is None:
        return notes
    lat, lon = (float(a[0, 0]) for a in degrees([patches[0].col], [patches[0].row]))
    hidden = Note(
        "zeros_are_voids" if len(patches) == 1 else "zeros_are_voids_in_several_places",
        nodes=sum(patch.nodes for patch in patches), largest=patches[0].nodes, lat_deg=lat, lon_deg=lon,
        more=len(patches) - 1, beside_m=min(patch.beside_m for patch in patches),
    )  # fmt: skip
    return [*notes, hidden]


def _looked_beyond(window: Window, blind: Bools, wider: Iterable[Window]) -> tuple[list[Voids], list[Note]]:
    """The nodes of ``blind`` patches, which fill the window to its border, that larger windows show to be voids."""
    rows, cols = blind.shape
    for large in wider:
        left = round((window.x[0] - large.x[0]) / (window.x[1] - window.x[0]))
        top = round((window.y[0] - large.y[0]) / (window.y[1] - window.y[0]))
        here = slice(top, top + rows), slice(left, left + cols)
        seen = zero_voids(large.heights_m)
        still = blind & seen.blind[here]
        if still.any():
            continue
        void = blind & seen.nodes[here]
        if not void.any():
            return [], []
        row, col = (int(k[0]) for k in np.nonzero(void))
        nodes = int(np.count_nonzero(void))
        patch = Patch(nodes, row, col, min(p.beside_m for p in seen.patches))
        return [Voids(void, [patch], np.zeros_like(void))], []
    return [], [Note("zeros_without_neighbours", nodes=int(np.count_nonzero(blind)))]


class Voids(NamedTuple):
    """Which nodes lie in patches of zeros without a shore, these patches, the largest one first, and which nodes lie
    in patches without any known node beside them."""

    nodes: Bools
    patches: list[Patch]
    blind: Bools


def zero_voids(heights_m: Floats) -> Voids:
    """The connected patches of exactly 0 that have no shore.

    ``heights_m`` (rows, cols), NaN where unknown. Nodes are connected to all eight around them. A patch has a shore if
    a known node beside it lies within `SHORE_M` of 0; one without any known node beside it is no patch to judge.
    """
    zero = heights_m == 0.0
    if not zero.any():
        return Voids(zero, [], zero)
    from scipy.ndimage import label  # most terrain holds no zeros

    nothing = np.zeros(zero.shape, np.bool_)
    patch, count = label(zero, np.ones((3, 3)))
    nearest = np.full(count + 1, np.inf)
    rows, cols = zero.shape
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        upper, lower = slice(0, rows - down), slice(down, rows)
        left, far = slice(max(0, -right), cols - max(0, right)), slice(max(0, right), cols - max(0, -right))
        for at, beside in (((upper, left), (lower, far)), ((lower, far), (upper, left))):
            shore = zero[at] & ~zero[beside] & ~np.isnan(heights_m[beside])
            np.minimum.at(nearest, patch[at][shore], np.abs(heights_m[beside][shore]))
    alone = np.isinf(nearest)
    alone[0] = False  # cells that are not zero
    blind = np.asarray(alone[patch]) if alone.any() else nothing
    void = np.isfinite(nearest) & (nearest > SHORE_M)
    if not void.any():
        return Voids(nothing, [], blind)
    taken = void[patch]
    at_node = np.flatnonzero(taken)
    sizes = np.bincount(patch.ravel()[at_node], minlength=count + 1)
    first = np.full(count + 1, zero.size)
    np.minimum.at(first, patch.ravel()[at_node], at_node)
    found = [
        Patch(int(sizes[k]), int(first[k]) // cols, int(first[k]) % cols, float(nearest[k]))
        for k in np.flatnonzero(void)
    ]
    return Voids(np.asarray(taken), sorted(found, key=lambda p: (-p.nodes, p.row, p.col)), blind)
