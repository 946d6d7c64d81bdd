"""A page's part of the conversation with the server of `gcsplan map`, over raw sockets and a plain WebSocket."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from websockets.sync.client import ClientConnection, connect

from gcsplan.page.edits import Edits
from gcsplan.page.guard import PageAddress
from gcsplan.page.map_session import MapSession
from gcsplan.page.server import MapServer
from gcsplan.page.steps.flight_steps import PageSteps
from gcsplan.units import METRIC

ANSWER_S = 30.0

FLAT = """\
# head
version: 1
name: field
terrain: {flat_m: 100}
limits: {min_agl_m: 30}   # of all
no_fly:
  - {name: mast, center: [46.505, 8.5], radius_m: 150}   # the mast
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    start: [46.5, 8.5]   # the meadow
    goal: [46.51, 8.51]
"""


def raw(server: MapServer, request: bytes) -> bytes:
    """The head of the answer to the bytes of one request, and what follows until the server is silent or done."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=ANSWER_S) as connection:
        connection.sendall(request)
        answer = b""
        connection.settimeout(5.0)
        while b"\r\n\r\n" not in answer and (part := connection.recv(65536)):
            answer += part
    return answer


def get(server: MapServer, path: str, *, method: str = "GET", **headers: str) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of one request below the token; a path that begins with / is whole."""
    whole = path if path.startswith("/") else server.url.removeprefix(f"http://127.0.0.1:{server.port}") + path
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    lines = {"Host": f"127.0.0.1:{server.port}", "Connection": "close", **given}
    head = f"{method} {whole} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in lines.items()) + "\r\n"
    with socket.create_connection(("127.0.0.1", server.port), timeout=ANSWER_S) as connection:
        connection.sendall(head.encode())
        answer = b""
        while part := connection.recv(65536):
            answer += part
    top, _, body = answer.partition(b"\r\n\r\n")
    first, *rest = top.decode("latin-1").split("\r\n")
    found = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in rest)}
    return int(first.split()[1]), found, body


class Page:
    """One page: `send` numbers its messages, `until` reads answers."""

    def __init__(self, server: MapServer, **headers: str) -> None:
        self.n = 0
        self.heard: list[dict[str, Any]] = []
        own = {"Origin": f"http://127.0.0.1:{server.port}", **headers}
        url = server.url.replace("http://", "ws://") + "socket"
        self._opened = ExitStack()
        self.socket: ClientConnection = self._opened.enter_context(
            connect(url, additional_headers=own, max_size=None, compression=None, proxy=None, open_timeout=ANSWER_S)
        )

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._opened.close()

    def send(self, kind: str, **more: Any) -> int:
        """Send a message; its number."""
        self.n += 1
        self.socket.send(json.dumps({"type": kind, "n": self.n, **more}))
        return self.n

    def until(self, *kinds: str, n: int | None = None) -> dict[str, Any]:
        """The next answer of one of these kinds that counts the newest message, or message ``n``."""
        want, end_s = self.n if n is None else n, time.monotonic() + ANSWER_S
        while True:
            answer: dict[str, Any] = json.loads(self.socket.recv(timeout=max(0.1, end_s - time.monotonic())))
            self.heard.append(answer)
            if answer["type"] in kinds and answer["n"] == want:
                return answer


@contextmanager
def serving(mission: Path | None, folder: Path, kept: PageAddress | None = None) -> Iterator[MapServer]:
    """A server of a mission, or of none in a folder; again at a kept address."""
    session = MapSession(Edits.of_folder(folder) if mission is None else Edits.of_file(mission), METRIC, PageSteps)
    server = MapServer(session, kept=kept)
    server.start()
    try:
        yield server
    finally:
        server.stop()
        session.close()


def eventually(seen: Callable[[], bool], seconds: float = 10.0) -> bool:
    """Whether something is so within some time."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        if seen():
            return True
        time.sleep(0.02)
    return seen()


def plain(answer: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    """Some keys of an answer."""
    return {key: answer[key] for key in keys}
