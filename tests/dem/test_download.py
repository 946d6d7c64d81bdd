"""One object over a bad network: it comes whole and right, or an error says why and nothing wrong is kept."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import numpy as np
import pytest

from gcsplan.dem.download import Arrived, DownloadPatience, ServerUnreachable, download, is_address
from gcsplan.errors import LinkError
from tests.support.tiles import Served, send, serving

QUICK = DownloadPatience(stall_s=10.0, whole_s=60.0, tries=3, pause_s=0.001)
DATA = np.random.default_rng(1).bytes(400_000)
PATH = "/bucket/object.tif"
MOST = 2**20


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with serving(Served({PATH: DATA})) as server:
        yield server


def bring(served: Served, folder: Path, *, most: int = MOST, patience: DownloadPatience = QUICK) -> Arrived:
    return download(served.url + PATH, folder / "object.part", most_bytes=most, patience=patience)


def refusal(served: Served, folder: Path, *, most: int = MOST, patience: DownloadPatience = QUICK) -> LinkError:
    with pytest.raises(LinkError) as caught:
        bring(served, folder, most=most, patience=patience)
    assert caught.value.exit_code == 6
    return caught.value


def test_an_object_comes_whole_with_its_checksum(served: Served, tmp_path: Path) -> None:
    arrived = bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA
    assert arrived.sha256 == hashlib.sha256(DATA).hexdigest()
    assert arrived.bytes == len(DATA)
    assert arrived.agrees
    assert arrived.etag == f'"{hashlib.md5(DATA).hexdigest()}"'


def of_parts(data: bytes, part: int) -> str:
    """The ETag of an object that was uploaded in parts."""
    sums = [hashlib.md5(data[k : k + part]).digest() for k in range(0, len(data), part)]
    return f'"{hashlib.md5(b"".join(sums)).hexdigest()}-{len(sums)}"'


@pytest.mark.slow
def test_the_checksum_of_an_object_uploaded_in_parts_is_found(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served.objects[PATH] = data = DATA * 40  # 15.3 MiB
    for part, agrees in ((8 << 20, True), (5 << 20, True), (7 << 20, False)):

        def trouble(request: BaseHTTPRequestHandler, path: str, number: int, part: int = part) -> bool:
            send(request, data, etag=of_parts(data, part))
            return True

        served.trouble = trouble
        assert bring(served, tmp_path, most=2**25).agrees is agrees
        (tmp_path / "object.part").unlink()


def test_a_connection_that_breaks_again_and_again_is_resumed_where_it_broke(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        send(request, DATA, cut=60_000)  # seven times more often than tries without progress are allowed
        return True

    served.trouble = trouble
    bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA
    firsts = [int(span.removeprefix("bytes=").removesuffix("-") or 0) for _, span in served.requests]
    assert firsts == [60_000 * k for k in range(7)]


def test_what_an_earlier_run_left_is_continued(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if number == 1:
            send(request, DATA, cut=150_000)
        else:
            request.send_error(503)
        return True

    served.trouble = trouble
    assert "150000 bytes are kept" in str(refusal(served, tmp_path))
    served.trouble = lambda request, path, number: False
    bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA
    assert served.requests[-1][1] == "bytes=150000-"


def test_a_part_of_another_version_is_not_continued(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if number == 1:
            send(request, b"x" * len(DATA), cut=150_000)
        return number == 1

    served.trouble = trouble
    bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA


def test_without_an_etag_every_try_begins_anew(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        send(request, DATA, cut=None if number == 3 else 100_000 * number, etag="")
        return True

    served.trouble = trouble
    bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA
    assert {span for _, span in served.requests} == {""}


def test_a_wrong_checksum_is_never_kept(served: Served, tmp_path: Path) -> None:
    right = f'"{hashlib.md5(DATA).hexdigest()}"'

    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        send(request, DATA[:-1] + b"\0", etag=right)
        return True

    served.trouble = trouble
    assert "its checksum is wrong" in str(refusal(served, tmp_path))
    assert list(tmp_path.iterdir()) == []
    served.trouble = lambda request, path, number: False
    assert bring(served, tmp_path).etag == right


def test_a_file_that_somebody_else_writes_to_is_not_believed(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        send(request, DATA, etag="")  # so that its length alone can tell
        return True

    def meddle(have: int, whole: int | None) -> None:
        if have == whole:
            with (tmp_path / "object.part").open("ab") as file:
                file.write(b"more")

    served.trouble = trouble
    with pytest.raises(LinkError, match="another length on the disk"):
        download(served.url + PATH, tmp_path / "object.part", most_bytes=MOST, patience=QUICK, report=meddle)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.first_quick
@pytest.mark.parametrize("code", [404, 403, 410])
def test_what_is_not_there_is_asked_for_once(served: Served, tmp_path: Path, code: int) -> None:
    served.trouble = lambda request, path, number: request.send_error(code) is None
    assert f"the server answers {code}" in str(refusal(served, tmp_path))
    assert len(served.requests) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.first_quick
@pytest.mark.parametrize("code", [503, 429, 500])
def test_a_server_that_is_busy_is_asked_again(served: Served, tmp_path: Path, code: int) -> None:
    served.trouble = lambda request, path, number: number < 3 and request.send_error(code) is None
    bring(served, tmp_path)
    assert len(served.requests) == 3


def test_a_silent_server_is_left(served: Served, tmp_path: Path) -> None:
    served.trouble = lambda request, path, number: time.sleep(0.3) is None
    begun = time.monotonic()
    error = refusal(served, tmp_path, patience=DownloadPatience(stall_s=0.1, whole_s=60.0, tries=2, pause_s=0.0))
    assert time.monotonic() - begun < 20.0
    assert isinstance(error, ServerUnreachable)


def test_a_slow_server_is_left_when_the_time_is_over(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        request.send_response(200)
        request.send_header("Content-Length", str(len(DATA)))
        request.end_headers()
        for k in range(100):
            request.wfile.write(DATA[k : k + 1])
            request.wfile.flush()
            time.sleep(0.02)
        return True

    served.trouble = trouble
    begun = time.monotonic()
    error = refusal(served, tmp_path, patience=DownloadPatience(stall_s=10.0, whole_s=0.3, tries=3, pause_s=0.0))
    assert "0.3 s are over" in str(error)
    assert time.monotonic() - begun < 20.0


def test_nobody_there_is_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with serving(Served()) as gone:
        pass
    with pytest.raises(ServerUnreachable, match=r"no answer: .*refused; 3 tries"):
        download(gone.url + PATH, tmp_path / "part", most_bytes=MOST, patience=QUICK)


def test_more_than_may_come_is_refused_before_it_comes(served: Served, tmp_path: Path) -> None:
    assert "400000 bytes long, more than the 1000" in str(refusal(served, tmp_path, most=1000))

    def endless(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        request.protocol_version = "HTTP/1.1"
        request.send_response(200)
        request.send_header("Transfer-Encoding", "chunked")
        request.end_headers()
        for _ in range(50):
            request.wfile.write(b"400\r\n" + b"x" * 1024 + b"\r\n")
        return True

    served.trouble = endless
    assert "more than 20000 bytes came" in str(refusal(served, tmp_path, most=20_000))
    assert list(tmp_path.iterdir()) == []


def test_an_answer_whose_length_nobody_knows_is_refused(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        request.send_response(200)
        request.end_headers()
        request.wfile.write(DATA)
        return True

    served.trouble = trouble
    assert "the server gives no length" in str(refusal(served, tmp_path))


def test_a_server_that_continues_another_part_is_not_believed(served: Served, tmp_path: Path) -> None:
    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if number == 1:
            send(request, DATA, cut=100_000)
        elif number == 2:
            request.send_response(206)
            request.send_header("Content-Range", f"bytes 0-{len(DATA) - 1}/{len(DATA)}")
            request.send_header("Content-Length", str(len(DATA)))
            request.end_headers()
            request.wfile.write(DATA)
        return number < 3

    served.trouble = trouble
    bring(served, tmp_path)
    assert (tmp_path / "object.part").read_bytes() == DATA


def test_a_redirect_is_followed_but_not_to_a_file(served: Served, tmp_path: Path) -> None:
    def elsewhere(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if path != PATH:
            return False
        request.send_response(302)
        request.send_header("Location", target)
        request.end_headers()
        return True

    served.objects["/other"] = DATA
    served.trouble = elsewhere
    target = served.url + "/other"
    bring(served, tmp_path)
    target = "ftp://127.0.0.1/x"
    assert "redirected to ftp://127.0.0.1/x, which is not followed" in str(refusal(served, tmp_path))
    target = "file:///etc/hostname"
    assert "is not allowed" in str(refusal(served, tmp_path))


@pytest.mark.parametrize(
    ("text", "good"),
    [
        ("https://mirror.example/dem", True), ("http://127.0.0.1:8000", True), ("mirror.example", False),
        ("file:///srv/dem", False), ("https://", False), ("https://a/b?c=d", False), ("https://[", False),
    ],
)  # fmt: skip
def test_an_address_is_http_of_a_host(text: str, good: bool) -> None:
    assert is_address(text) is good


HOSTILE: list[tuple[int, dict[str, str]]] = [
    (302, {"Location": location})
    for location in (
        "http://[", "http://[::1", "http://" + "a" * 300 + "/", "http://a..b/", "http://127.0.0.1:99999/x",
        "http://127.0.0.1:x/", "//[/", "http://\x01/", "http://" + "é" * 70 + ".example/", "http:///", "?" * 5000,
        "http://127.0.0.1:1/%zz", "javascript:1", "http://user:pw@[/",
    )
] + [
    (200, {"Content-Length": length})
    for length in ("\u00b2", "9" * 5000, "-1", "1e5", " ", "0x10", "\u00b3" * 400, "+5", "1_000")
] + [
    (206, {"Content-Length": "5", "Content-Range": f"bytes {span}"})
    for span in ("0-4/" + "9" * 5000, "0-\u00b2/5", "x", "-/-")
] + [
    (200, {"Content-Length": "5", "ETag": "x" * 60_000}), (200, {"Content-Length": "5", "Content-Encoding": "br"}),
    (304, {}), (999, {"Content-Length": "0"}),
]  # fmt: skip


@pytest.mark.parametrize("answer", range(len(HOSTILE)))
def test_an_answer_that_nobody_can_read_is_that_object_s_failure(served: Served, tmp_path: Path, answer: int) -> None:
    code, headers = HOSTILE[answer]

    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if path != PATH:
            return False
        lines = [f"HTTP/1.0 {code} x\x1b[31m", *(f"{name}: {value}" for name, value in headers.items()), "", "12345"]
        request.wfile.write("\r\n".join(lines).encode("latin-1"))
        return True

    served.trouble = trouble
    if "ETag" in headers:
        assert bring(served, tmp_path).etag == ""  # a record holds no tag of any length
    else:
        assert "\x1b" not in str(refusal(served, tmp_path))
