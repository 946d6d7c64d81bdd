"""Link URLs in pymavlink's and MAVSDK's notations, and the direction that each one means.

========================================  =====================================================
``udpin:HOST:PORT``, ``udp:…``            listens (``udp:`` listens, as in pymavlink)
``udpout:HOST:PORT``                      sends, from a port that stays the same for this place
``udpout:HOST:PORT,LOCAL``                sends from the port LOCAL (0: any free one)
``tcp:HOST:PORT``, ``tcpout:…``           connects
``tcpin:HOST:PORT``                       waits for connections
``/dev/ttyUSB0,57600``, ``COM3,57600``    serial port
``serial:DEVICE:BAUD``                    serial port
========================================  =====================================================

All forms but the bare device names may be written with ``://``. IPv6 addresses are written in brackets.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass
from typing import Literal

from gcsplan.errors import InputError

DEFAULT_BAUD = 57600
URL_FORMS = (
    "udpin:HOST:PORT (listens; udp: is the same), udpout:HOST:PORT (sends; ,LOCAL after it is the port to send from), "
    "tcp:HOST:PORT (connects), tcpin:HOST:PORT (waits), /dev/ttyUSB0,57600 or COM3,57600 or serial:DEVICE:BAUD; also "
    "with ://"
)

_SCHEMES: dict[str, tuple[Literal["udp", "tcp"], bool]] = {
    "udp": ("udp", True),
    "udpin": ("udp", True),
    "udpout": ("udp", False),
    "tcp": ("tcp", False),
    "tcpout": ("tcp", False),
    "tcpin": ("tcp", True),
}
_BARE_DEVICE = re.compile(r"(?P<device>/dev/[^,\s]+|(\\\\\.\\)?COM\d+)(,(?P<baud>[^,]*))?", re.I | re.A)
_HERE = ("", "0.0.0.0", "127.0.0.1", "localhost", "::", "::1")
_EVERYWHERE = ("", "0.0.0.0", "::")
_MOST_BAUD = 12_000_000
_LEAST_LOCAL, _LOCAL_PORTS = 20_000, 12_768  # below the ports that systems give to programs that ask for any
_DEFAULT_PORT = 14550
_PX4_OWN_PORTS = range(18570, 18570 + 256)  # where simulated PX4s listen; they send to 14550


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Our end of a link. ``listens``: peers come to us; else we go to them. ``host``: empty for serial ports.

    ``local_port``: the port that UDP datagrams are sent from, 0 for any free one; None: `sends_from` chooses it.
    """

    kind: Literal["udp", "tcp", "serial"]
    listens: bool
    host: str
    port: int
    device: str = ""
    baud: int = 0
    local_port: int | None = None

    @property
    def sends_from(self) -> int:
        """The port that an outgoing UDP link sends from: ``local_port``, or one that depends on the place alone.

        PX4 speaks only to the address and port that it heard first after it booted, so a later command must come from
        the same port.
        """
        if self.local_port is not None:
            return self.local_port
        return _LEAST_LOCAL + (zlib.crc32(self.host.lower().encode()) + self.port) % _LOCAL_PORTS

    @property
    def place(self) -> str:
        """Host and port, or device and baud rate."""
        if self.kind == "serial":
            return f"{self.device} at {self.baud} baud"
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def far_end(self) -> tuple[str, bool, str, int]:
        """The far end of the link, however its URL is written: all names of this machine are one place."""
        here = self.listens or self.host.lower() in _HERE
        return self.kind, self.listens, self.device or ("" if here else self.host.lower()), self.port

    @property
    def url(self) -> str:
        """The URL in pymavlink's notation."""
        if self.kind == "serial":
            bare = _BARE_DEVICE.fullmatch(self.device)
            return f"{self.device},{self.baud}" if bare else f"serial://{self.device}:{self.baud}"
        own = "" if self.local_port is None else f",{self.local_port}"
        return f"{self._scheme(self.listens)}:{self.place}{own}"

    def understood(self) -> str:
        """Return one clause about what the link does: ``udpout: sends to 127.0.0.1:14560``."""
        if self.kind == "serial":
            return f"serial: opens {self.place}"
        if self.kind == "udp":
            return f"udpin: listens on {self.place}" if self.listens else f"udpout: sends to {self.place}"
        return f"tcpin: waits for connections on {self.place}" if self.listens else f"tcp: connects to {self.place}"

    def other_direction(self) -> str:
        """Return what to try if nobody answers: the other direction, at an address that makes sense there."""
        if self.kind == "serial":
            return "another device or baud rate"
        turned = self._scheme(not self.listens)
        if self.kind == "tcp":
            return f"{turned}:{self.place}"
        if self.listens:
            host = "VEHICLE" if self.host in _EVERYWHERE else self.place.rsplit(":", 1)[0]
            return f"{turned}:{host}:{self.port} (sends to the vehicle)"
        host = self.place.rsplit(":", 1)[0] if self.host in _HERE else "0.0.0.0"
        port = _DEFAULT_PORT if self.port in _PX4_OWN_PORTS else self.port
        return f"{turned}:{host}:{port} (listens)"

    def _scheme(self, listens: bool) -> str:
        return {("udp", True): "udpin", ("udp", False): "udpout", ("tcp", True): "tcpin"}.get(
            (self.kind, listens), "tcp"
        )


def parse_url(text: str) -> Endpoint:
    """Parse ``text``. Raises InputError that lists the known forms. Port 0 listens on any free port."""
    given = text.strip()
    bare = _BARE_DEVICE.fullmatch(given)
    if bare:
        return _serial(given, bare["device"], bare["baud"])
    scheme, colon, rest = given.partition(":")
    scheme = scheme.lower()
    slashes = rest.startswith("//")
    if scheme == "serial" and colon:
        match = re.fullmatch(r"(?P<device>.*?)([:,](?P<baud>[^:,]*))?", rest[2:] if slashes else rest)
        return _serial(given, match["device"], match["baud"] or None) if match else _serial(given, "", None)
    if scheme not in _SCHEMES or not colon:
        raise _wrong(given, "is not a link that we know")
    kind, listens = _SCHEMES[scheme]
    rest, local = _local_port(given, rest[2:] if slashes else rest, allowed=kind == "udp" and not listens)
    host, port = _host_and_port(given, rest, listens)
    if scheme == "udp" and slashes and host not in _HERE:
        raise _wrong(given, f"may mean either direction: write udpin://{host}:{port} or udpout://{host}:{port}")
    return Endpoint(kind, listens, host, port, local_port=local)


def _local_port(given: str, rest: str, *, allowed: bool) -> tuple[str, int | None]:
    """Split off the port to send from, which only ``udpout:`` has."""
    rest, comma, local = rest.partition(",")
    if not comma:
        return rest, None
    if not allowed:
        raise _wrong(given, "has a comma: only udpout:HOST:PORT,LOCAL sends from a port of its own")
    if not re.fullmatch(r"[0-9]{1,5}", local) or int(local) > 65535:
        raise _wrong(given, f"sends from port {local!r}; give a port within 1 … 65535, or 0 for any free one")
    return rest, int(local)


def _host_and_port(given: str, rest: str, listens: bool) -> tuple[str, int]:
    match = re.fullmatch(r"(\[(?P<v6>[0-9A-Fa-f:.%\w]+)\]|(?P<host>[^\[\]:/\s,]*)):(?P<port>[0-9]{1,5})", rest)
    if match is None and listens and re.fullmatch(r"[0-9]{1,5}", rest):
        match = re.fullmatch(r"(?P<v6>)(?P<host>)(?P<port>[0-9]{1,5})", rest)
    if match is None:
        raise _wrong(given, "wants HOST:PORT after the colon, an IPv6 address in brackets")
    port = int(match["port"])
    if port > 65535 or (port == 0 and not listens):
        raise _wrong(given, f"has port {port}; a port lies within 1 … 65535")
    host = match["v6"] or match["host"] or ("0.0.0.0" if listens else "")
    if not host:
        raise _wrong(given, "sends to no host")
    return host, port


def _serial(given: str, device: str, baud: str | None) -> Endpoint:
    if not device or any(c.isspace() or not c.isprintable() for c in device):
        raise _wrong(given, "names no serial device")
    if baud is None:
        return Endpoint("serial", False, "", 0, device, DEFAULT_BAUD)
    if not re.fullmatch(r"[0-9]{1,8}", baud) or not 0 < int(baud) <= _MOST_BAUD:
        raise _wrong(given, f"has baud rate {baud!r}; give a number such as 57600 or 115200")
    return Endpoint("serial", False, "", 0, device, int(baud))


def _wrong(given: str, why: str) -> InputError:
    shown = given if len(given) <= 80 else given[:77] + "…"
    return InputError(f"link {shown!r} {why}. Known forms: {URL_FORMS}", where="link")
