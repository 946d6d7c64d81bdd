"""Brings one object over HTTP into a file: bounded in time, bytes and tries, and resumed where it broke off.

Only this module of the package uses the network, and only `gcsplan dem fetch` uses this module.
"""

from __future__ import annotations

import hashlib
import http.client
import json
import re
import ssl
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from email.message import Message
from pathlib import Path
from typing import IO, Any

from gcsplan import __version__
from gcsplan.errors import LinkError

DownloadReport = Callable[[int, int | None], None]
"""Called with the number of bytes received and of the whole, if known."""

BLOCK_BYTES = 65_536
LONGEST_PAUSE_S = 30.0
MOST_SIDE_BYTES = 4096
MOST_ETAG = 200

PART_MB = (5, 8, 10, 15, 16, 20, 25, 32, 50, 64, 100, 128)
"""Sizes of the parts, MiB, in which programs upload to S3: the ETag is then a checksum of the parts' checksums."""

_MD5 = re.compile(r'"([0-9a-f]{32})(?:-(\d{1,5}))?"')
_PASSING = frozenset({408, 425, 429, 500, 502, 503, 504})


@dataclass(frozen=True, slots=True)
class DownloadPatience:
    """How long to try: seconds without a byte, seconds for one object, tries in a row that bring nothing new.

    ``pause_s`` is the first pause between tries; it doubles up to `LONGEST_PAUSE_S`.
    """

    stall_s: float = 20.0
    whole_s: float = 1800.0
    tries: int = 5
    pause_s: float = 0.5


@dataclass(frozen=True, slots=True)
class Arrived:
    """The received object: bytes, checksum, the server's ETag, and whether that ETag is a checksum that agrees."""

    bytes: int
    sha256: str
    etag: str
    agrees: bool


class ServerUnreachable(LinkError):
    """No server answered at all, so that other objects of it need not be tried."""


class _Again(Exception):
    """This try failed; another one may succeed."""


@dataclass
class _PartFile:
    """The part of an object that was received, with the mark of its version."""

    file: Path
    url: str
    etag: str = ""
    have: int = field(default=0)

    @property
    def side(self) -> Path:
        return self.file.with_name(self.file.name + ".json")

    def look(self) -> None:
        """Take a part that an earlier run left, if it is of this address and its version is known."""
        self.etag, self.have = "", 0
        with suppress(OSError, ValueError):
            with self.side.open("rb") as file:
                kept = json.loads(file.read(MOST_SIDE_BYTES))
            if isinstance(kept, dict) and kept.get("url") == self.url and isinstance(kept.get("etag"), str):
                self.have, self.etag = self.file.stat().st_size, kept["etag"]

    def begin(self, etag: str) -> None:
        """Start anew; a weak ETag does not distinguish versions, so that such a part is not resumed."""
        self.drop()
        self.etag, self.have = "" if etag.startswith("W/") else etag, 0
        if self.etag:
            self.side.write_text(json.dumps({"url": self.url, "etag": self.etag}), encoding="utf-8")

    def drop(self) -> None:
        """Remove it."""
        self.side.unlink(missing_ok=True)
        self.file.unlink(missing_ok=True)
        self.have = 0


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Never from https to something that can be read and changed on the way."""

    max_redirections = 5

    def http_error_302(self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Message) -> Any:
        """Follow a redirect; an address that cannot be read leaves no connection open."""
        try:
            return super().http_error_302(req, fp, code, msg, headers)  # type: ignore[arg-type]
        except (ValueError, LookupError, ArithmeticError):
            fp.close()
            raise

    http_error_301 = http_error_303 = http_error_307 = http_error_308 = http_error_302

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Message, newurl: str
    ) -> urllib.request.Request | None:
        secure = req.full_url.startswith("https:")
        if not newurl.startswith("https:" if secure else ("http:", "https:")):
            fp.close()
            raise LinkError(f"redirected to {_words(newurl)}, which is not followed", where=req.full_url)
        return super().redirect_request(req, fp, code, msg, headers, newurl)  # type: ignore[arg-type]


def is_address(text: str) -> bool:
    """Whether a text is an http or https address of a host."""
    try:
        parts = urllib.parse.urlsplit(text)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and not parts.query and not parts.fragment
    except ValueError:
        return False


def download(
    url: str,
    file: Path,
    *,
    most_bytes: int,
    patience: DownloadPatience | None = None,
    report: DownloadReport | None = None,
) -> Arrived:
    """Bring ``url`` whole into ``file``; a part of it that an earlier call left there is continued.

    Raises LinkError if it cannot be had; what came so far then stays, unless it is known to be wrong. Raises OSError if
    the disk does not take it.
    """
    patience = patience or DownloadPatience()
    until = time.monotonic() + patience.whole_s
    part = _PartFile(file, url)
    part.look()
    most_had, answered, failures, pause_s = part.have, False, 0, patience.pause_s
    while True:
        try:
            length = _try(part, most_bytes, patience, until, report)
            return _checked(part, length)
        except _Again as why:
            answered = answered or not isinstance(why.__cause__, urllib.error.URLError | OSError) or part.have > 0
            if part.have > most_had:
                failures, pause_s = 0, patience.pause_s
            failures += 1
            most_had = max(most_had, part.have)
            left_s = until - time.monotonic()
            if failures >= patience.tries or left_s <= 0.0:
                kind = LinkError if answered else ServerUnreachable
                tried = f"{failures} tries brought nothing new" if left_s > 0.0 else f"{patience.whole_s:g} s are over"
                raise kind(f"{why}; {tried}, {part.have} bytes are kept", where=url, reason="download") from None
        time.sleep(max(0.0, min(pause_s, left_s)))
        pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)


def _try(
    part: _PartFile, most_bytes: int, patience: DownloadPatience, until: float, report: DownloadReport | None
) -> int:
    """One request; returns the length of the whole once all of it is there."""
    headers = {"User-Agent": f"gcsplan/{__version__}", "Accept-Encoding": "identity"}
    if part.have and part.etag:
        headers |= {"Range": f"bytes={part.have}-", "If-Range": part.etag}
    try:
        with _opener().open(urllib.request.Request(part.url, headers=headers), timeout=patience.stall_s) as answer:
            length = _begin(part, answer, most_bytes)
            _take(part, answer, length, min(most_bytes, length or most_bytes), until, report)
    except LinkError:  # a ConnectionError too, and final
        raise
    except urllib.error.HTTPError as why:
        _refused(part, why)
    except urllib.error.URLError as why:
        if isinstance(why.reason, ssl.SSLCertVerificationError):
            raise LinkError(f"its certificate is not trusted: {why.reason}", where=part.url) from None
        raise _Again(f"no answer: {_words(why.reason)}") from why
    except (http.client.HTTPException, TimeoutError, ConnectionError, ssl.SSLError) as why:
        raise _Again(f"the connection broke: {_words(why)}") from why
    except (ValueError, LookupError, ArithmeticError) as why:
        # The library raises these for addresses in redirects and for headers that nobody can read.
        raise LinkError(f"the server's answer cannot be read: {_words(why)}", where=part.url) from why
    if length is not None and part.have != length:
        raise _Again(f"the connection ended after {part.have} of {length} bytes")
    return part.have


def _opener() -> urllib.request.OpenerDirector:
    """HTTP and HTTPS alone: no file:, ftp: or data:, in an address or in a redirect."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(), urllib.request.UnknownHandler(), urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(), urllib.request.HTTPDefaultErrorHandler(), _Redirects(),
        urllib.request.HTTPErrorProcessor(),
    ):  # fmt: skip
        opener.add_handler(handler)
    return opener


def _begin(part: _PartFile, answer: Any, most_bytes: int) -> int | None:
    """Read an answer's headers; returns the length of the whole, None if the answer comes in chunks."""
    if answer.headers.get("Content-Encoding", "identity").lower() != "identity":
        raise LinkError("the server compresses its answer, although the request excluded that", where=part.url)
    etag = answer.headers.get("ETag", "")
    etag = etag if len(etag) <= MOST_ETAG else ""
    if answer.status == 206:
        span = re.fullmatch(r"bytes ([0-9]{1,15})-([0-9]{1,15})/([0-9]{1,15})", answer.headers.get("Content-Range", ""))
        if span is None or int(span[1]) != part.have or (etag and etag != part.etag):
            part.drop()
            raise _Again("the server continued another part than the requested one")
        length: int | None = int(span[3])
    elif answer.status == 200:
        part.begin(etag)
        stated = answer.headers.get("Content-Length", "")
        length = int(stated) if re.fullmatch("[0-9]{1,15}", stated) else None
        if length is None and answer.headers.get("Transfer-Encoding", "").lower() != "chunked":
            raise LinkError("the server gives no length, so that nobody could see a loss", where=part.url)
    else:
        raise LinkError(f"the server answers {answer.status} {_words(answer.reason)}", where=part.url)
    if length is not None and length > most_bytes:
        raise LinkError(f"it is {length} bytes long, more than the {most_bytes} that it may be", where=part.url)
    return length


def _take(
    part: _PartFile, answer: Any, length: int | None, most_bytes: int, until: float, report: DownloadReport | None
) -> None:
    with part.file.open("ab") as into:
        while block := _block(answer):
            part.have += len(block)
            if part.have > most_bytes:
                part.drop()
                raise LinkError(f"more than {most_bytes} bytes came", where=part.url)
            into.write(block)
            if report is not None:
                report(part.have, length)
            if time.monotonic() > until:
                raise _Again(f"slow: {part.have} of {length if length is not None else 'unknown'} bytes came")


def _block(answer: Any) -> bytes:
    """The next bytes of the answer; faults of the network and of the disk are kept apart."""
    try:
        return bytes(answer.read1(BLOCK_BYTES))
    except OSError as why:
        raise _Again(f"the connection broke: {_words(why)}") from why


def _refused(part: _PartFile, why: urllib.error.HTTPError) -> None:
    """Turn an HTTP error into one of ours."""
    with why:
        if why.code in _PASSING:
            raise _Again(f"the server answers {why.code} {_words(why.reason)}")
        if why.code == 416:  # the kept part is longer than the object is now
            part.drop()
            raise _Again("the kept part is of another version")
        raise LinkError(f"the server answers {why.code} {_words(why.reason)}", where=part.url, reason="download")


def _checked(part: _PartFile, length: int) -> Arrived:
    """Compare the received bytes with their length and, where the server's ETag is an MD5 as S3 makes them, with it.

    The size of the parts in which a file was uploaded is not known: if one of `PART_MB` agrees, the file is right; if
    none agrees, nothing is known.
    """
    sha256, md5 = hashlib.sha256(), hashlib.md5(usedforsecurity=False)
    count = 0
    with part.file.open("rb") as file:
        while block := file.read(1 << 20):
            sha256.update(block)
            md5.update(block)
            count += len(block)
    digest = _MD5.fullmatch(part.etag)
    whole = digest is not None and digest[2] is None
    agrees = digest is not None and (
        digest[1] == md5.hexdigest() if whole else _agree(part.file, digest[1], int(digest[2]))
    )
    if count != length or (whole and not agrees):
        etag = part.etag
        part.drop()
        raise _Again(
            f"its checksum is wrong (the server's is {etag})"
            if count == length
            else "it has another length on the disk"
        )
    return Arrived(count, sha256.hexdigest(), part.etag, agrees)


def _agree(file: Path, expected: str, parts: int) -> bool:
    """Whether ``expected`` is the MD5 of the MD5s of this many parts of the file, of some usual size."""
    size = file.stat().st_size
    for part_bytes in (mb << 20 for mb in PART_MB if -(-size // (mb << 20)) == parts):
        whole = hashlib.md5(usedforsecurity=False)
        with file.open("rb") as opened:
            while block := opened.read(part_bytes):
                whole.update(hashlib.md5(block, usedforsecurity=False).digest())
        if whole.hexdigest() == expected:
            return True
    return False


def _words(why: object) -> str:
    """The first line of a stranger's text, without characters that a terminal would obey."""
    line = (str(why).strip() or type(why).__name__).splitlines()[0][:200]
    return "".join(c if c.isprintable() else "\ufffd" for c in line)
