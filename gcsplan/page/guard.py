"""`Guard`: lets only the page itself talk to the server: its own host, its own origin, its own token.

A page of another site can send requests to 127.0.0.1, and by a name that it lets point there (DNS rebinding) it can
read the answers, unless the Host header is checked. Browsers send the Origin of the page that opens a WebSocket, and
nothing else keeps a foreign page from opening one.

A new start for the same mission has the port and the token of the last one, so that an open page goes on. While no
server runs, another user's program may take the port. So a page that lost its server sends the token to nobody before
the answer to a random text (`proof_of`) shows that the other end knows it, and a token counts at its own port alone:
where the port is taken, or a day has passed, the address is a new one.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
import secrets
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gcsplan.native import cache

AsgiScope = MutableMapping[str, Any]
AsgiReceive = Callable[[], Awaitable[MutableMapping[str, Any]]]
AsgiSend = Callable[[MutableMapping[str, Any]], Awaitable[None]]
AsgiApp = Callable[[AsgiScope, AsgiReceive, AsgiSend], Awaitable[None]]

TOKEN_BYTES = 24
KEPT_S = 86_400.0
"""Seconds for which the address of a mission is kept, counted from the last start or end of its server."""

PROOF = "proof/"
"""Before a random text: the one path without a token."""

_TOKEN_TEXT = re.compile(r"[A-Za-z0-9_-]{32}")

REFUSALS = {403: b"forbidden\n", 404: b"not found\n", 405: b"method not allowed\n", 429: b"too many requests\n"}

DROPPED = "dropped/"
"""Below the token, where the page puts a file; only a request that says its origin may."""

GOOD_SITES = (b"same-origin", b"none")
"""Values of Sec-Fetch-Site of the page's own requests, and of a user who opens it."""

MOST_PATH = 1024
"""Characters of a path; what reads numbers of it meets none that Python refuses to count."""

REQUESTS_PER_S, BURST = 400.0, 800.0
"""Requests that are answered each second on average, and at once; the map asks for tiles by the dozen."""


@dataclass(frozen=True, slots=True)
class PageAddress:
    """Port and token of a page; ``at_s``: when they were last in use, seconds of the clock.

    They are kept per mission in the user's private cache: a file (0600) in a folder (0700) that nobody else reads.
    """

    port: int
    token: str
    at_s: float = field(default_factory=time.time)

    @classmethod
    def kept(cls, place: Path) -> PageAddress | None:
        """The address of the mission at ``place`` of an earlier run; None if there is none, or only an old one."""
        try:
            found = cls(**json.loads(cache.read_kept(_kept_as(place)) or b"{}"))
            good = (
                _TOKEN_TEXT.fullmatch(found.token) and 0 < found.port < 2**16 and abs(time.time() - found.at_s) < KEPT_S
            )
        except (ValueError, TypeError):
            return None
        return found if good else None

    def keep(self, place: Path) -> None:
        """Keep it for the next run of the mission at ``place``; without a private cache the next address is new."""
        cache.keep(_kept_as(place), json.dumps(asdict(self)).encode())


def _kept_as(place: Path) -> str:
    return cache.name_of_code("map", hashlib.sha256(str(place.absolute()).encode("utf-8", "replace")).hexdigest())


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def proof_of(token: str, text: str) -> str:
    """What only a server that knows the token can answer to a random text; it tells nothing of the token."""
    return hmac.new(token.encode(), f"gcsplan map {text}".encode(), "sha256").hexdigest()


class Rate:
    """A bucket of tokens: ``per_s`` on average, ``burst`` at once."""

    def __init__(self, per_s: float, burst: float) -> None:
        self._per_s, self._burst = per_s, burst
        self._left, self._at_s = burst, time.monotonic()

    def allows(self) -> bool:
        """Whether one more is allowed now; it is counted if so."""
        now_s = time.monotonic()
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Guard:
    """An ASGI application in front of ``app``, which sees paths without the token.

    ``port`` is the server's; ``map_host`` the origin of a base map that the user gave, or empty; ``token`` a kept one.
    """

    def __init__(self, app: AsgiApp, port: int, map_host: str = "", token: str = "") -> None:
        self.token = token or new_token()
        self._app = app
        self._host = f"127.0.0.1:{port}".encode()
        self._origin = b"http://" + self._host
        self._headers = list(_headers(f"127.0.0.1:{port}", map_host))
        self._rate = Rate(REQUESTS_PER_S, BURST)

    async def __call__(self, scope: AsgiScope, receive: AsgiReceive, send: AsgiSend) -> None:
        """Answer one request, or one WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        status = self._refusal(scope)
        if status:
            given = scope["path"].removeprefix(f"/{PROOF}")
            if status == 404 and scope["type"] == "http" and scope["method"] == "GET" and _TOKEN_TEXT.fullmatch(given):
                await _answer(send, 200, proof_of(self.token, given).encode(), self._headers)
            else:
                await _refuse(scope, receive, send, status, self._headers)
            return
        _, _, rest = scope["path"].removeprefix("/").partition("/")
        inner = {**scope, "path": f"/{rest}", "raw_path": f"/{rest}".encode()}

        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                own = [*message.get("headers", [])]
                known = {name.lower() for name, _ in own}
                message["headers"] = [*own, *(row for row in self._headers if row[0] not in known)]
            await send(message)

        await self._app(inner, receive, with_headers)

    def _refusal(self, scope: AsgiScope) -> int:
        """The status of a refusal; 0 for the page's own requests."""
        if not self._rate.allows():
            return 429
        given: dict[bytes, list[bytes]] = {}
        for name, value in scope["headers"]:
            given.setdefault(name.lower(), []).append(value)
        if given.get(b"host") != [self._host]:
            return 403
        origins = given.get(b"origin", [])
        own = origins == [self._origin]
        if not own and (origins or scope["type"] == "websocket"):
            return 403
        if any(site not in GOOD_SITES for site in given.get(b"sec-fetch-site", [])):
            return 403
        token = scope["path"].removeprefix("/").partition("/")[0]
        known = secrets.compare_digest(token.encode("utf-8", "replace"), self.token.encode())
        if not known or len(scope["path"]) > MOST_PATH:
            return 404
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            dropped = scope["path"].removeprefix("/").partition("/")[2].startswith(DROPPED)
            return 0 if own and scope["method"] == "PUT" and dropped else 405
        return 0


async def _refuse(
    scope: AsgiScope, receive: AsgiReceive, send: AsgiSend, status: int, headers: Iterable[tuple[bytes, bytes]]
) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})  # before it is accepted: 403
        return
    await _answer(send, status, REFUSALS[status], headers)


async def _answer(send: AsgiSend, status: int, words: bytes, headers: Iterable[tuple[bytes, bytes]]) -> None:
    start = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(words)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": [*start, *headers]})
    await send({"type": "http.response.body", "body": words})


def _headers(host: str, map_host: str) -> Iterable[tuple[bytes, bytes]]:
    more = f" {map_host}" if map_host else ""
    policy = (
        f"default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; worker-src blob:; child-src blob:; "
        f"img-src 'self' data: blob:{more}; connect-src 'self' ws://{host}{more}; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )
    yield b"content-security-policy", policy.encode()
    yield b"referrer-policy", b"no-referrer"
    yield b"x-content-type-options", b"nosniff"
    yield b"x-frame-options", b"DENY"
    yield b"cross-origin-opener-policy", b"same-origin"
    yield b"cross-origin-resource-policy", b"same-origin"
    yield b"permissions-policy", b"geolocation=(), camera=(), microphone=()"
