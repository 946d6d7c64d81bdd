"""The server of `gcsplan map`: one page, one WebSocket, terrain tiles; at 127.0.0.1 alone.

docs/reference/map-protocol.md describes what it sends.
"""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import socket
import threading
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError, UsageError
from gcsplan.page.base_map import BaseMap
from gcsplan.page.guard import AsgiApp, Guard, PageAddress, Rate, new_token
from gcsplan.page.map_session import MapSession, PageMessage
from gcsplan.page.refused import PageError, not_installed

try:
    import uvicorn
    from starlette.applications import Starlette
    from starlette.requests import ClientDisconnect, Request
    from starlette.responses import FileResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket, WebSocketDisconnect
except ModuleNotFoundError as missing:
    raise not_installed(missing.name) from None

HOST = "127.0.0.1"
STATIC = Path(__file__).parent / "static"
REPORT = Path(__file__).parents[1] / "report" / "assets"
REPORT_FILES = (
    "report.css", "numbers.js", "labels.js", "base.js", "view.js", "flight.js", "replay.js", "mesh.js", "scene.js"
)  # fmt: skip
"""Assets of the report that the page uses, too."""

MAP_FILES = ("maplibre-gl.js", "maplibre-gl.css")
MEDIA_TYPES = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".png": "image/png"
}  # fmt: skip

MOST_MESSAGE_BYTES = 256 * 2**10
MESSAGES_PER_S, MESSAGE_BURST = 240.0, 480.0
MOST_CONNECTIONS = 48
MOST_HEADER_BYTES = 16 * 2**10
MOST_DEPTH = 12
"""Lists and mappings of a message that lie in each other at most."""

MOST_N = 2**53
HURRY_S = 0.05
"""Seconds between two looks at whether a plan is superseded."""

TAKEN_OVER, TOO_MANY = 4000, 4008
"""Codes with which a WebSocket is closed."""

LEAVE_S = 2
"""Seconds that open connections get when the server ends."""

REPORT_POLICY = "sandbox allow-scripts allow-modals; frame-ancestors 'none'"
"""Beside the report's own policy, which allows its one script and no request at all."""

ForClient = Mapping[str, str]
CACHED: ForClient = {"cache-control": "private, max-age=86400"}
LOOKED_UP: ForClient = {"cache-control": "no-cache"}


class MapServer:
    """Serves the page of ``session`` at a free port, or at ``port``; `url` is its address. Raises UsageError.

    ``kept``: the address of an earlier run, which it has again if the port is free and no other one is given.
    Runs in a thread of its own, from `start` to `stop`.
    """

    def __init__(
        self, session: MapSession, *, port: int = 0, base: BaseMap | None = None, kept: PageAddress | None = None
    ) -> None:
        self._session, self._base = session, base
        self._files = files_served()
        self._socket, token = _bound_again(port, kept)
        self.port = int(self._socket.getsockname()[1])
        self._guard = Guard(self._app(), self.port, "" if base is None else base.host, token)
        self._server = uvicorn.Server(
            uvicorn.Config(
                self._guard, log_config=None, access_log=False, server_header=False, date_header=False, lifespan="off",
                ws="websockets-sansio", ws_max_size=MOST_MESSAGE_BYTES, ws_per_message_deflate=False,
                limit_concurrency=MOST_CONNECTIONS, h11_max_incomplete_event_size=MOST_HEADER_BYTES, http="h11",
                timeout_graceful_shutdown=LEAVE_S, timeout_keep_alive=20,
            )
        )  # fmt: skip
        self._page: WebSocket | None = None
        self._thread = threading.Thread(target=self._run, name="map server", daemon=True)

    @property
    def url(self) -> str:
        """The address of the page, with its token."""
        return f"http://{HOST}:{self.port}/{self._guard.token}/"

    @property
    def address(self) -> PageAddress:
        """What an open page needs to find the next server of this mission."""
        return PageAddress(self.port, self._guard.token)

    @property
    def has_page(self) -> bool:
        """Whether a page is open."""
        return self._page is not None

    def start(self) -> None:
        """Serve from now on."""
        self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Wait for the end of the server, at most so long; whether it still runs."""
        self._thread.join(seconds)
        return self._thread.is_alive()

    def stop(self) -> None:
        """Close all connections, and end."""
        self._server.should_exit = True
        self._thread.join()

    def _run(self) -> None:
        log = logging.getLogger("uvicorn.error")
        log.addFilter(self._is_news)
        try:
            asyncio.run(self._serve())
        finally:
            log.removeFilter(self._is_news)

    async def _serve(self) -> None:
        # Signals stay with the main thread: uvicorn would take them only there.
        hurrying = asyncio.create_task(self._hurry())
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            hurrying.cancel()

    def _is_news(self, _: logging.LogRecord) -> bool:
        """Whether a line of the log is shown: requests that the end breaks off are none."""
        return not self._server.should_exit

    async def _hurry(self) -> None:
        while True:
            await asyncio.sleep(HURRY_S)
            self._session.hurry()

    def _app(self) -> AsgiApp:
        return Starlette(
            routes=[
                Route("/", self._file),
                Route("/terrain/{revision:int}/{z:int}/{x:int}/{y:int}.png", self._terrain),
                Route("/contours/{revision:int}/{units}/{z:int}/{x:int}/{y:int}.json", self._contours),
                Route("/report.html", self._report),
                Route("/base/{z:int}/{x:int}/{y:int}", self._base_tile),
                WebSocketRoute("/socket", self._talk),
                Route("/dropped/{name}", self._drop, methods=["PUT"]),
                Route("/{path:path}", self._file),
            ]
        )

    async def _file(self, request: Request) -> Response:
        """One of the files that were found at the start: no path of a request reaches the disk."""
        file = self._files.get(request.path_params.get("path", "") or "static/index.html")
        if file is None:
            return Response("not found\n", status_code=404, media_type="text/plain")
        return FileResponse(file, media_type=MEDIA_TYPES[file.suffix], headers=dict(LOOKED_UP))

    async def _report(self, _: Request) -> Response:
        """The newest report that was written, as a page that reaches neither the map's page nor its server."""
        text = self._session.steps.report
        if not text:
            return Response("no report was written yet\n", status_code=404, media_type="text/plain")
        return Response(text, media_type="text/html", headers={"content-security-policy": REPORT_POLICY, **LOOKED_UP})

    async def _terrain(self, request: Request) -> Response:
        place = (int(request.path_params[key]) for key in ("revision", "z", "x", "y"))
        return _tile(await asyncio.to_thread(self._session.tile, *place), "image/png")

    async def _contours(self, request: Request) -> Response:
        # The units stand in the address for the browser's cache alone: a page has those of its session.
        place = (int(request.path_params[key]) for key in ("revision", "z", "x", "y"))
        return _tile(await asyncio.to_thread(self._session.contours, *place), "application/geo+json")

    async def _base_tile(self, request: Request) -> Response:
        place = (int(request.path_params[key]) for key in ("z", "x", "y"))
        found = None if self._base is None else await asyncio.to_thread(self._base.tile, *place)
        return _tile(found, "" if self._base is None else self._base.media_type)

    async def _drop(self, request: Request) -> Response:
        """Take the bytes of a dropped file, no more than one of its kind may have; nothing of it is read here."""
        size = request.headers.get("content-length", "")
        try:
            bytes_ = int(size) if size.isdigit() else None
            more = request.query_params.get("more") == "yes"
            coming = self._session.shelf.receive(request.path_params["name"], bytes_, more=more)
            async for part in request.stream():
                coming.add(part)
            held = self._session.shelf.put(coming)
        except InputError as why:
            return Response(_json({"error": str(why)}), media_type="application/json")
        except ClientDisconnect:
            return Response(status_code=400)
        return Response(_json({"name": held.name, "kind": held.kind}), media_type="application/json")

    async def _talk(self, page: WebSocket) -> None:
        """Take the messages of the page; one page at a time counts, the newest."""
        await page.accept()
        before, self._page = self._page, page
        outward: asyncio.Queue[PageMessage] = asyncio.Queue()
        loop = asyncio.get_running_loop()
        if before is not None:
            await _taken_over(before)

        def send(answer: PageMessage) -> None:
            if self._page is page and not loop.is_closed():
                loop.call_soon_threadsafe(outward.put_nowait, answer)

        self._session.attach(send)
        sending = asyncio.create_task(_sent(page, outward))
        rate = Rate(MESSAGES_PER_S, MESSAGE_BURST)
        try:
            while True:
                text = await page.receive_text()
                if not rate.allows():
                    await page.close(TOO_MANY)
                    return
                try:
                    self._session.hand_in(read_message(text))
                except PageError as why:
                    await page.send_text(_json({"type": "error", "n": 0, "code": why.code, "message": why.message,
                                                "where": why.where}))  # fmt: skip
        except (WebSocketDisconnect, KeyError, RuntimeError):
            pass  # it left, or sent bytes
        finally:
            sending.cancel()
            if self._page is page:
                self._page = None
                self._session.steps.left()


async def _sent(page: WebSocket, outward: asyncio.Queue[PageMessage]) -> None:
    """Send what the session answers; of live paths that wait, the last of each vehicle alone."""
    while True:
        waiting = [await outward.get()]
        while not outward.empty():
            waiting.append(outward.get_nowait())
        last = {a.get("vehicle"): k for k, a in enumerate(waiting) if a["type"] == "path" and a["live"]}
        for k, answer in enumerate(waiting):
            if answer["type"] == "path" and answer["live"] and last[answer["vehicle"]] != k:
                continue
            await page.send_text(_json(answer))


async def _taken_over(page: WebSocket) -> None:
    words = "this mission is open in another tab, which has taken over"
    try:
        await page.send_text(_json({"type": "error", "n": 0, "code": "taken_over", "message": words, "where": ""}))
        await page.close(TAKEN_OVER)
    except (RuntimeError, WebSocketDisconnect):
        pass  # it is gone already


def read_message(text: str) -> PageMessage:
    """A message of the page. Raises PageError for what is none."""
    try:
        message = json.loads(text, parse_constant=_no_number)
        deep = _depth(message) > MOST_DEPTH
    except (ValueError, RecursionError):
        raise PageError("a message is one object of JSON", code="bad_message") from None
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise PageError("a message is an object with its type", code="bad_message")
    n = message.get("n")
    if isinstance(n, bool) or not isinstance(n, int) or not 0 < n <= MOST_N:
        raise PageError("a message has n, a whole number that grows", code="bad_message", where="n")
    if deep:
        raise PageError(f"a message has lists in each other, {MOST_DEPTH} deep at most", code="bad_message")
    return message


def _no_number(word: str) -> float:
    raise ValueError(word)


def _depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max(map(_depth, inner), default=0)


def _json(answer: PageMessage) -> str:
    # In ASCII: a file's name may hold bytes that are no text, and what cannot be encoded would end the sending.
    return json.dumps(answer, separators=(",", ":"))


def _tile(data: bytes | None, media_type: str) -> Response:
    if data is None:
        return Response("no tile\n", status_code=404, media_type="text/plain")
    return Response(data, media_type=media_type, headers=dict(CACHED))


def files_served() -> dict[str, Path]:
    """Each file of the page by its path below the token: its own, MapLibre's, and some of the report's.

    Raises InputError where the package of MapLibre is not installed.
    """
    found = find_spec("maplibre")  # looked up, not imported: the package imports much that is not needed
    if found is None or not found.submodule_search_locations:
        raise not_installed("maplibre")
    library = Path(next(iter(found.submodule_search_locations))) / "srcjs"
    files = {f"static/{file.name}": file for file in STATIC.iterdir() if file.suffix in MEDIA_TYPES}
    files |= {f"lib/{name}": library / name for name in MAP_FILES}
    files |= {f"report/{name}": REPORT / name for name in REPORT_FILES}
    missing = [str(file) for file in files.values() if not file.is_file()]
    if missing:
        raise InputError(f"the map lacks {missing[0]}: install gcsplan[map] again", where="gcsplan map")
    return files


def _bound_again(port: int, kept: PageAddress | None) -> tuple[socket.socket, str]:
    """A socket and a token: the kept ones, or a new token where that port is taken. Raises UsageError."""
    if kept is not None and port in (0, kept.port):
        with suppress(UsageError):
            return _bound(kept.port), kept.token
    return _bound(port), new_token()


def _bound(port: int) -> socket.socket:
    """A socket at 127.0.0.1. Raises UsageError for a port that is taken."""
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if hasattr(socket, "SO_EXCLUSIVEADDRUSE"):  # Windows, where SO_REUSEADDR would let others take it over
            made.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((HOST, port))
        made.listen(MOST_CONNECTIONS)  # a page that is opened before the server runs waits for it
    except (OSError, OverflowError) as why:
        made.close()
        taken = isinstance(why, OSError) and why.errno in (errno.EADDRINUSE, errno.EACCES)
        words = "is taken: give another, or leave --port out for a free one" if taken else f"cannot be opened: {why}"
        raise UsageError(f"--port {port} {words}") from None
    return made
