"""The map's server over loopback: what the page gets, and what nobody else gets."""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from websockets.exceptions import ConnectionClosed, InvalidStatus

from gcsplan.errors import UsageError
from gcsplan.page.guard import PageAddress
from gcsplan.page.map_session import MapSession
from gcsplan.page.server import LEAVE_S, MapServer
from tests.page.talk import FLAT, Page, get, raw, serving

pytestmark = pytest.mark.xdist_group("map")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("map")
    (folder / "field.yaml").write_text(FLAT)
    (folder.parent / "secret.yaml").write_text("secret: 1\n")
    return folder


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[MapServer]:
    with serving(folder / "field.yaml", folder) as server:
        yield server


@pytest.mark.slow
def test_the_page_and_its_parts_are_served_with_a_strict_policy(server: MapServer) -> None:
    script = "text/javascript"
    for path, kind in (("", "text/html"), ("lib/maplibre-gl.js", script), ("report/report.css", "text/css")):
        status, headers, body = get(server, path)
        assert (status, headers["content-type"].partition(";")[0]) == (200, kind), path
        assert body
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("host", ["localhost", "evil.example", "127.0.0.1", "127.0.0.1:1", "[::1]"])
def test_another_host_gets_nothing_because_a_name_may_be_rebound(server: MapServer, host: str) -> None:
    status, _, body = get(server, "", Host=host)
    assert (status, body) == (403, b"forbidden\n")


def test_two_hosts_or_none_get_nothing(server: MapServer) -> None:
    own = f"Host: 127.0.0.1:{server.port}\r\n"
    path = server.url.removeprefix(f"http://127.0.0.1:{server.port}")
    for hosts in (own + "Host: evil.example\r\n", ""):
        answer = raw(server, f"GET {path} HTTP/1.1\r\n{hosts}Connection: close\r\n\r\n".encode())
        assert answer.split()[1] in (b"400", b"403")


@pytest.mark.parametrize("path", ["/", "/x/", "/static/main.js", "/socket", "/" + "A" * 32 + "/", "/%00/", "/../"])
def test_without_the_token_nothing_is_there(server: MapServer, path: str) -> None:
    status, _, body = get(server, path)
    assert (status, body) == (404, b"not found\n")


def test_a_foreign_page_reaches_neither_page_nor_socket(server: MapServer) -> None:
    assert get(server, "", Origin="http://evil.example")[0] == 403
    assert get(server, "", Sec_Fetch_Site="cross-site")[0] == 403
    assert get(server, "", Sec_Fetch_Site="same-site")[0] == 403
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{server.port}", "http://127.0.0.1"):
        with pytest.raises(InvalidStatus) as refused:
            Page(server, Origin=origin)
        assert refused.value.response.status_code == 403


def test_a_socket_without_origin_or_with_a_wrong_token_is_refused(server: MapServer) -> None:
    path = server.url.removeprefix(f"http://127.0.0.1:{server.port}")
    own = f"http://127.0.0.1:{server.port}"
    for where, origin in ((f"{path}socket", ""), ("/wrong/socket", f"Origin: {own}\r\n")):
        answer = raw(server, (
            f"GET {where} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n{origin}\r\n"
        ).encode())  # fmt: skip
        assert answer.split()[1] == b"403"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"])
def test_nothing_is_taken_by_other_methods(server: MapServer, method: str) -> None:
    assert get(server, "", method=method)[0] == 405


@pytest.mark.parametrize(
    "path",
    ["../secret.yaml", "static/../../secret.yaml", "static/%2e%2e/%2e%2e/secret.yaml", "..%2fsecret.yaml",
     "static//etc/passwd", "static/..\\secret.yaml", "lib/../page/server.py", "field.yaml", "static/", "%00",
     "terrain/1/0/0/0.png/../../../../secret.yaml", "report/page.py"],
)  # fmt: skip
def test_no_path_leads_to_another_file(server: MapServer, path: str) -> None:
    status, _, body = get(server, path)
    assert (status, body) == (404, b"not found\n")


@pytest.mark.parametrize(
    ("path", "status"),
    [("terrain/1/12/2144/1455.png", 200), ("terrain/99/12/2144/1455.png", 404), ("terrain/1/30/0/0.png", 404),
     ("terrain/1/12/99999/0.png", 404), (f"terrain/1/12/{'9' * 40}/0.png", 404), ("base/1/0/0", 404),
     pytest.param(f"terrain/1/12/{'9' * 5000}/0.png", 404, id="long x"),
     pytest.param(f"base/{'9' * 5000}/0/0", 404, id="long z")],
)  # fmt: skip
def test_tiles_are_there_or_are_not(server: MapServer, path: str, status: int) -> None:
    with Page(server) as page:
        page.send("hello")
        page.until("state")
    found, headers, body = get(server, path)
    assert found == status
    assert (headers["content-type"] == "image/png" and body.startswith(b"\x89PNG")) == (status == 200)


def test_a_request_of_endless_headers_is_cut_off(server: MapServer) -> None:
    answer = raw(server, b"GET / HTTP/1.1\r\nX: " + b"a" * 100_000)
    assert answer == b"" or answer.split()[1] in (b"400", b"431")
    assert get(server, "")[0] == 200


BAD = [
    "", "{", "[]", "1", "null", '{"type":1,"n":1}', '{"type":"hello"}', '{"type":"hello","n":-1}',
    '{"type":"hello","n":true}', '{"type":"hello","n":1e400}', '{"type":"hello","n":NaN}', "[" * 5000,
    "[" * 900 + "]" * 900, json.dumps({"type": "change", "n": 1, "changes": {"a": [[[[[[[[[[[[[[1]]]]]]]]]]]]]]}}),
]  # fmt: skip


def test_broken_messages_are_answered_in_words_and_change_nothing(server: MapServer) -> None:
    with Page(server) as page:
        page.send("hello")
        before = page.until("state")["vehicles"]
        for text in BAD:
            page.socket.send(text)
            answer = page.until("error", n=0)
            assert answer["code"] == "bad_message", text
        page.send("nothing of the kind")
        assert page.until("error")["code"] == "bad_message"
        page.send("hello")
        assert page.until("state")["vehicles"] == before


@pytest.mark.slow
def test_names_that_are_no_text_do_not_end_the_answers(server: MapServer, folder: Path) -> None:
    (folder / os.fsdecode(b"\xff.tif")).write_bytes(b"")
    try:
        with Page(server) as page:
            for half in ("\ud83d", "\ude00"):
                page.send("change", changes={"vehicles[0].name": half})
                assert "half of a character" in json.dumps(page.until("error"))
            page.send("hello")
            state = page.until("state")
            assert os.fsdecode(b"\xff.tif") in state["files"]
            assert not state["undo"]
    finally:
        (folder / os.fsdecode(b"\xff.tif")).unlink()


BAD_CHANGES: list[Any] = [
    None, {}, [], {"terrain.dem": "/etc/passwd"}, {"terrain": {"dem": "x"}}, {"no_fly[1]": {"file": "/etc/passwd"}},
    {"no_fly[0].file": "x"}, {"vehicles[0].link": "udpout:10.0.0.1:1"}, {"wind.forecast": "/etc/x"}, {"version": 2},
    {"vehicles[0]": {}}, {"vehicles": []}, {"__proto__.x": 1}, {"limits.min_agl_m.x": 1}, {"a" * 10_000: 1},
    {"no_fly[9]": None}, {"vehicles[7].goal": [1, 2]}, {f"no_fly[{k}]": None for k in range(200)},
]  # fmt: skip


@pytest.mark.slow
def test_keys_that_name_files_or_links_cannot_be_changed(server: MapServer) -> None:
    with Page(server) as page:
        page.send("hello")
        before = page.until("state")
        for changes in BAD_CHANGES:
            page.send("change", changes=changes)
            assert page.until("error")["code"] in ("bad_change", "bad_message", "bad_mission"), changes
        page.send("hello")
        after = page.until("state")
        assert (after["vehicles"], after["zones"], after["undo"]) == (before["vehicles"], before["zones"], False)


def test_a_message_that_is_too_large_closes_the_socket(server: MapServer) -> None:
    with Page(server) as page:
        page.socket.send('{"type":"hello","n":1,"x":"' + "a" * 300_000 + '"}')
        with pytest.raises(ConnectionClosed):
            page.until("state")


@pytest.mark.slow
def test_a_flood_closes_the_socket_and_the_server_goes_on(server: MapServer) -> None:
    with Page(server) as page:
        with suppress(ConnectionClosed):
            for _ in range(3000):
                page.send("place", text="46.5, 8.5")
        with pytest.raises(ConnectionClosed):
            page.until("never")
    with Page(server) as page:
        page.send("hello")
        assert page.until("state")["stage"] == "mission"


@pytest.mark.slow
def test_a_second_tab_takes_over_and_the_first_is_told(server: MapServer) -> None:
    with Page(server) as first:
        first.send("hello")
        first.until("plan")
        with Page(server) as second:
            second.send("hello")
            second.until("plan")
            assert first.until("error", n=0)["code"] == "taken_over"
            with pytest.raises(ConnectionClosed) as closed:
                first.until("never")
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4000


def test_connections_are_limited_and_come_back(server: MapServer) -> None:
    import socket

    held = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(60)]
    try:
        assert get(server, "")[0] == 503
    finally:
        for connection in held:
            connection.close()
    assert any(get(server, "")[0] == 200 for _ in range(50))


def test_a_port_that_is_taken_is_one_message(server: MapServer) -> None:
    with pytest.raises(UsageError, match=rf"--port {server.port} is taken"):
        MapServer(None, port=server.port)  # type: ignore[arg-type]


def test_a_kept_address_counts_at_its_own_port_alone(server: MapServer) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    kept, servers = PageAddress(port, "t" * 32), list[MapServer]()
    for address in (kept, PageAddress(server.port, "t" * 32), kept):
        servers.append(MapServer(SimpleNamespace(hurry=lambda: None), kept=address))  # type: ignore[arg-type]
        servers[-1].start()
    first, *others = (made.address for made in servers)
    for made in servers:
        made.stop()
    assert (first.port, first.token) == (port, kept.token)
    for other in others:  # who has the port may have heard the token
        assert other.port not in (server.port, port)
        assert other.token != kept.token


def put(server: MapServer, path: str, body: bytes, *, origin: str = "", length: int | None = None) -> tuple[int, str]:
    """Status and words of a file that is sent to a path below the token."""
    own = f"127.0.0.1:{server.port}"
    whole = server.url.removeprefix(f"http://{own}") + path
    head = f"PUT {whole} HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\nOrigin: {origin or f'http://{own}'}\r\n"
    size = len(body) if length is None else length
    answer = b""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10.0) as connection:
        connection.sendall(f"{head}Content-Length: {size}\r\n\r\n".encode() + body)
        with suppress(ConnectionResetError):  # the server leaves bytes unread that it does not take
            while more := connection.recv(65536):
                answer += more
    top, _, words = answer.partition(b"\r\n\r\n")
    return int(top.split()[1]), words.decode()


def test_a_file_comes_from_the_page_alone_and_has_no_more_bytes_than_its_kind_may(server: MapServer) -> None:
    assert put(server, "dropped/z.kml", b"<kml/>")[0] == 200
    assert put(server, "dropped/z.kml", b"<kml/>", origin="http://localhost:1")[0] == 403
    assert get(server, "dropped/z.kml", method="PUT")[0] == 405  # without its origin
    for path in ("static/z.kml", "z.kml", "dropped/..%2Fz.kml", "dropped/"):
        assert put(server, path, b"<kml/>")[0] in (404, 405), path
    status, words = put(server, "dropped/z.kml", b"", length=10**12)
    assert (status, "more than" in words) == (200, True)
    status, words = put(server, "dropped/run.sh", b"")
    assert (status, "run.sh" in json.loads(words)["error"]) == (200, True)


def test_a_dropped_file_is_read_when_the_page_looks_and_not_before(server: MapServer) -> None:
    assert put(server, "dropped/broken%20zones.kml", b"not XML")[0] == 200
    with Page(server) as page:
        page.send("inspect")
        found = page.until("dropped")
    assert (found["name"], found["kind"], bool(found["error"])) == ("broken_zones.kml", "zones", True)


@pytest.mark.slow
@pytest.mark.nightly
def test_an_end_while_tiles_are_made_prints_nothing(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    begun = threading.Event()

    def slow(*_: int) -> None:
        begun.set()
        time.sleep(2.0 * LEAVE_S)

    monkeypatch.setattr(MapSession, "tile", slow)
    with serving(file, file.parent) as server:
        path, host = server.url.removeprefix("http://").split("/", 1)[1], f"127.0.0.1:{server.port}"
        request = f"GET /{path}terrain/1/9/0/0.png HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
        asking = threading.Thread(target=raw, args=(server, request))
        asking.start()
        assert begun.wait(10.0)
    asking.join()
    assert caplog.records == []
