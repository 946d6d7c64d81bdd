"""A server of terrain tiles on 127.0.0.1, with every trouble that a network makes, and tiles and lists to serve."""

from __future__ import annotations

import hashlib
import io
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import rasterio
from rasterio.transform import Affine

from gcsplan.arrays import Floats
from gcsplan.dem.sources import GLO30, GLO90, SRTM, DemSource
from gcsplan.world.terrain.cell import Cell

ROWS = 36
"""Rows of a tile here: a hundredth of a real one's."""


def heights_of(cell: Cell, source: DemSource = GLO30, rows: int = ROWS) -> Floats:
    """Heights at the nodes of a tile: a smooth function of the place alone, so that neighbours fit together."""
    cols = rows * source.columns_of(cell) // 3600
    more = 1 if source.shares_edges else 0
    lat = cell.lat_deg + 1 - np.arange(rows + more) / rows
    lon = cell.lon_deg + np.arange(cols + more) / cols
    x, y = np.meshgrid(lon, lat)
    return np.asarray(height_at(y, x))


def height_at(lat_deg: Floats, lon_deg: Floats) -> Floats:
    """The heights that all tiles sample, metres."""
    return np.asarray(300.0 + 40.0 * np.sin(3.0 * lat_deg) + 30.0 * np.cos(5.0 * lon_deg))


def tile(cell: Cell, source: DemSource = GLO30, heights: Floats | None = None, **more: object) -> bytes:
    """The bytes of a GeoTIFF as the source has it: the first node on the north-west corner of the degree."""
    values = heights_of(cell, source) if heights is None else heights
    rows, cols = values.shape
    edge = 1 if source.shares_edges else 0
    dx, dy = 1.0 / (cols - edge), 1.0 / (rows - edge)
    with rasterio.MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=cols, height=rows, count=1, dtype="float32", crs="EPSG:4326", compress="deflate",
            transform=Affine(dx, 0.0, cell.lon_deg - 0.5 * dx, 0.0, -dy, cell.lat_deg + 1 + 0.5 * dy), **more,
        ) as dataset:  # fmt: skip
            dataset.write(values.astype(np.float32), 1)
        return bytes(memory.read())


def listing(source: DemSource, cells: Iterable[Cell]) -> bytes:
    """A list of tiles in the source's form, and as many as a list has at least, around the south pole."""
    return (_far_away(source) + _lines(source, cells) + ("</VRTDataset>\n" if source is SRTM else "")).encode()


@cache
def _far_away(source: DemSource) -> str:
    cells = [Cell(lat, lon) for lat in range(-90, -32) for lon in range(-180, 180)]
    return ("<VRTDataset>\n" if source is SRTM else "") + _lines(source, cells)


def _lines(source: DemSource, cells: Iterable[Cell]) -> str:
    if source is SRTM:
        return "".join(
            f'<SourceFilename relativeToVRT="1">SRTM_GL1_srtm/{c.name}.tif</SourceFilename>\n' for c in cells
        )
    # The published lists end their lines as DOS does.
    return "".join(source.object_of(c).split("/")[0] + "\r\n" for c in cells)


@dataclass
class Served:
    """A server's objects, by path, and its requests. ``trouble`` may answer a request itself, by its number, from 1."""

    objects: dict[str, bytes] = field(default_factory=dict)
    trouble: Callable[[BaseHTTPRequestHandler, str, int], bool] = lambda request, path, number: False
    requests: list[tuple[str, str]] = field(default_factory=list)
    url: str = ""

    def put(self, source: DemSource, name: str, data: bytes) -> None:
        """Add an object of a source."""
        self.objects[f"/{source.bucket}/{name}"] = data

    def put_tile(self, cell: Cell, source: DemSource = GLO30, **more: object) -> bytes:
        """Add a tile."""
        data = tile(cell, source, **more)  # type: ignore[arg-type]
        self.put(source, source.object_of(cell), data)
        return data

    def put_lists(self, *, land: Iterable[Cell] = (), lacking: Iterable[Cell] = (), source: DemSource = GLO30) -> None:
        """Add the lists: ``source`` and GLO-90 have ``land``, GLO-90 also the ``lacking`` tiles; the rest is sea."""
        self.put(source, source.listing, listing(source, land))
        self.put(GLO90, GLO90.listing, listing(GLO90, [*land, *lacking]))

    def paths(self, end: str = ".tif") -> list[str]:
        """Requested paths with this end."""
        return [path for path, _ in self.requests if path.endswith(end)]


def send(request: BaseHTTPRequestHandler, data: bytes, *, cut: int | None = None, etag: str | None = None) -> None:
    """Answer as S3 does: with length and MD5, or the requested range; after ``cut`` bytes the connection ends."""
    tag = f'"{hashlib.md5(data).hexdigest()}"' if etag is None else etag
    span, first = request.headers.get("Range"), 0
    if span is not None and request.headers.get("If-Range", tag) == tag:
        first = int(span.removeprefix("bytes=").removesuffix("-"))
        if first >= len(data):
            request.send_error(416)
            return
        request.send_response(206)
        request.send_header("Content-Range", f"bytes {first}-{len(data) - 1}/{len(data)}")
    else:
        request.send_response(200)
    if tag:
        request.send_header("ETag", tag)
    request.send_header("Content-Length", str(len(data) - first))
    request.end_headers()
    part = data[first:]
    request.wfile.write(part if cut is None else part[:cut])
    if cut is not None and cut < len(part):
        request.wfile.flush()
        request.connection.close()


@contextmanager
def serving(served: Served) -> Iterator[Served]:
    """Serve on a free port of 127.0.0.1."""
    counts: dict[str, int] = {}
    lock = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        timeout = 10

        def do_GET(self) -> None:
            with lock:
                served.requests.append((self.path, self.headers.get("Range", "")))
                counts[self.path] = counts.get(self.path, 0) + 1
                number = counts[self.path]
            try:
                if served.trouble(self, self.path, number):
                    return
                if self.path in served.objects:
                    send(self, served.objects[self.path])
                else:
                    self.send_error(404)
            except OSError:
                pass  # the client went away

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    served.url = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        yield served
    finally:
        server.shutdown()
        server.server_close()
        thread.join(5)


def read(data: bytes) -> Floats:
    """The heights of a GeoTIFF's bytes."""
    with rasterio.open(io.BytesIO(data)) as dataset:
        return np.asarray(dataset.read(1), float)
