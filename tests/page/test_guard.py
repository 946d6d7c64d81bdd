"""The guard in front of the map's server, without a socket; `test_server` has it behind one."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

from gcsplan.page.guard import Guard, Rate

Sent = list[MutableMapping[str, Any]]


async def _app(scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": [(b"x-path", scope["path"].encode())]})
    await send({"type": "http.response.body", "body": b"in"})


def answer_of(guard: Guard, path: str, *headers: tuple[bytes, bytes], kind: str = "http", method: str = "GET") -> Sent:
    """What the guard sends to one request."""
    sent: Sent = []

    async def receive() -> MutableMapping[str, Any]:
        return {"type": f"{kind}.connect"}

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(message)

    scope = {"type": kind, "path": path, "method": method, "headers": list(headers)}
    asyncio.run(guard(scope, receive, send))
    return sent


HOST = (b"host", b"127.0.0.1:8000")


def test_only_the_token_leads_in_and_the_app_never_sees_it() -> None:
    guard = Guard(_app, 8000)
    start, body = answer_of(guard, f"/{guard.token}/static/x.js", HOST)
    assert (start["status"], body["body"], dict(start["headers"])[b"x-path"]) == (200, b"in", b"/static/x.js")
    for path in ("/", f"/{guard.token[:-1]}/", f"/{guard.token}x/", f"//{guard.token}/", "/ü/"):
        assert answer_of(guard, path, HOST)[0]["status"] == 404, path


def test_two_servers_have_two_tokens_that_nobody_guesses() -> None:
    tokens = {Guard(_app, 8000).token for _ in range(20)}
    assert len(tokens) == 20
    assert min(map(len, tokens)) >= 32


def test_a_websocket_needs_the_own_origin_and_a_request_may_lack_it() -> None:
    guard = Guard(_app, 8000)
    origin = (b"origin", b"http://127.0.0.1:8000")
    inside = f"/{guard.token}/socket"
    assert answer_of(guard, inside, HOST, origin, kind="websocket")[0]["status"] == 200
    for headers in ((HOST,), (HOST, origin, origin), (HOST, (b"origin", b"http://localhost:8000")), (origin,)):
        assert answer_of(guard, inside, *headers, kind="websocket") == [{"type": "websocket.close", "code": 1008}]


def test_a_refusal_says_nothing_of_the_token_and_has_the_policy() -> None:
    guard = Guard(_app, 8000, "https://tiles.example")
    start, body = answer_of(guard, "/", (b"host", b"evil.example"))
    policy = dict(start["headers"])[b"content-security-policy"].decode()
    assert start["status"] == 403
    assert guard.token.encode() not in repr((start, body)).encode()
    assert "img-src 'self' data: blob: https://tiles.example;" in policy
    assert "script-src 'self';" in policy


def test_a_rate_allows_its_burst_and_then_its_average(monkeypatch: Any) -> None:
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    rate = Rate(10.0, 20.0)
    assert sum(rate.allows() for _ in range(50)) == 20
    now[0] += 1.0
    assert sum(rate.allows() for _ in range(50)) == 10
    now[0] += 1e6
    assert sum(rate.allows() for _ in range(50)) == 20


def test_requests_beyond_the_rate_are_too_many(monkeypatch: Any) -> None:
    monkeypatch.setattr("gcsplan.page.guard.BURST", 3.0)
    monkeypatch.setattr("gcsplan.page.guard.REQUESTS_PER_S", 1e-9)
    guard = Guard(_app, 8000)
    assert [answer_of(guard, "/", HOST)[0]["status"] for _ in range(5)] == [404, 404, 404, 429, 429]
