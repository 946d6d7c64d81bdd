"""The guard in front of the map's server, without a socket; `test_server` has it behind one."""

from __future__ import annotations

import asyncio
import time
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

import pytest

from gcsplan.page.guard import KEPT_S, Guard, PageAddress, Rate, new_token, proof_of

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


def test_a_server_proves_its_token_without_telling_it_and_to_its_own_host_alone() -> None:
    guard, text = Guard(_app, 8000, token="t" * 32), "r" * 32
    start, body = answer_of(guard, f"/proof/{text}", HOST)
    assert (start["status"], body["body"].decode()) == (200, proof_of("t" * 32, text))
    assert body["body"] != answer_of(Guard(_app, 8000), f"/proof/{text}", HOST)[1]["body"]
    for path in ("/proof/", "/proof/short", f"/proof/{text}/x", f"/{text}", f"/proof/{'ü' * 32}"):
        assert answer_of(guard, path, HOST)[0]["status"] == 404, path
    assert answer_of(guard, f"/proof/{text}", HOST, method="PUT")[0]["status"] == 404
    for foreign in (
        (b"host", b"evil.example"),
        (b"sec-fetch-site", b"cross-site"),
        (b"origin", b"http://evil.example"),
    ):
        assert answer_of(guard, f"/proof/{text}", HOST, foreign)[0]["status"] == 403


def test_an_address_is_kept_for_its_mission_for_a_day_where_nobody_else_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    place, address = tmp_path / "field.yaml", PageAddress(8123, new_token())
    assert PageAddress.kept(place) is None
    address.keep(place)
    assert (PageAddress.kept(place), PageAddress.kept(tmp_path / "other.yaml")) == (address, None)
    [file] = (tmp_path / "gcsplan").iterdir()
    assert (file.stat().st_mode & 0o777, file.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    file.chmod(0o666)  # somebody else may have put it there
    assert PageAddress.kept(place) is None
    for bad in (
        PageAddress(8123, "short"),
        PageAddress(0, new_token()),
        PageAddress(1, new_token(), time.time() - KEPT_S),
    ):
        bad.keep(place)
        assert PageAddress.kept(place) is None, bad
