"""Links as they are written: pymavlink's way, MAVSDK's way, and nonsense."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mavlink.link.url import DEFAULT_BAUD, Endpoint, parse_url
from tests.support.effort import draws


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udp:127.0.0.1:14550", Endpoint("udp", True, "127.0.0.1", 14550)),
        ("udpin:0.0.0.0:14550", Endpoint("udp", True, "0.0.0.0", 14550)),
        ("udpin::14550", Endpoint("udp", True, "0.0.0.0", 14550)),
        ("udpin:14550", Endpoint("udp", True, "0.0.0.0", 14550)),
        ("udpin:127.0.0.1:0", Endpoint("udp", True, "127.0.0.1", 0)),
        ("udpout:127.0.0.1:14560", Endpoint("udp", False, "127.0.0.1", 14560)),
        ("UDPOUT:drone.local:14560", Endpoint("udp", False, "drone.local", 14560)),
        ("tcp:127.0.0.1:5760", Endpoint("tcp", False, "127.0.0.1", 5760)),
        ("tcpin:0.0.0.0:5760", Endpoint("tcp", True, "0.0.0.0", 5760)),
        ("udpin://0.0.0.0:14540", Endpoint("udp", True, "0.0.0.0", 14540)),
        ("udp://:14540", Endpoint("udp", True, "0.0.0.0", 14540)),
        ("udpout://127.0.0.1:14540", Endpoint("udp", False, "127.0.0.1", 14540)),
        ("tcpout://10.0.0.1:5760", Endpoint("tcp", False, "10.0.0.1", 5760)),
        ("tcp://10.0.0.1:5760", Endpoint("tcp", False, "10.0.0.1", 5760)),
        ("tcpin://:5760", Endpoint("tcp", True, "0.0.0.0", 5760)),
        ("udpin:[::1]:14550", Endpoint("udp", True, "::1", 14550)),
        ("tcp://[fe80::1%eth0]:5760", Endpoint("tcp", False, "fe80::1%eth0", 5760)),
        ("/dev/ttyUSB0", Endpoint("serial", False, "", 0, "/dev/ttyUSB0", DEFAULT_BAUD)),
        ("/dev/ttyACM0,115200", Endpoint("serial", False, "", 0, "/dev/ttyACM0", 115200)),
        ("COM3", Endpoint("serial", False, "", 0, "COM3", DEFAULT_BAUD)),
        ("com12,57600", Endpoint("serial", False, "", 0, "com12", 57600)),
        ("serial:/dev/ttyUSB0:57600", Endpoint("serial", False, "", 0, "/dev/ttyUSB0", 57600)),
        ("serial:/dev/ttyUSB0", Endpoint("serial", False, "", 0, "/dev/ttyUSB0", DEFAULT_BAUD)),
        ("serial:/dev/ttyUSB0,9600", Endpoint("serial", False, "", 0, "/dev/ttyUSB0", 9600)),
        ("serial:///dev/ttyUSB0:921600", Endpoint("serial", False, "", 0, "/dev/ttyUSB0", 921600)),
        ("serial://COM4:57600", Endpoint("serial", False, "", 0, "COM4", 57600)),
        ("udpout:127.0.0.1:14560,14551", Endpoint("udp", False, "127.0.0.1", 14560, local_port=14551)),
        ("udpout://[::1]:14560,0", Endpoint("udp", False, "::1", 14560, local_port=0)),
        ("  udpout:127.0.0.1:14560\n", Endpoint("udp", False, "127.0.0.1", 14560)),
    ],
)
def test_a_link_is_understood(text: str, endpoint: Endpoint) -> None:
    assert parse_url(text) == endpoint
    assert parse_url(endpoint.url) == endpoint


@pytest.mark.parametrize(
    ("text", "sentence", "other"),
    [
        ("udpout:127.0.0.1:14560", "udpout: sends to 127.0.0.1:14560", "udpin:127.0.0.1:14560"),
        ("udpout:192.168.1.10:14550", "udpout: sends to 192.168.1.10:14550", "udpin:0.0.0.0:14550"),
        ("udpout:127.0.0.1:18571", "udpout: sends to 127.0.0.1:18571", "udpin:127.0.0.1:14550"),
        ("udp:0.0.0.0:14550", "udpin: listens on 0.0.0.0:14550", "udpout:VEHICLE:14550"),
        ("tcp:127.0.0.1:5760", "tcp: connects to 127.0.0.1:5760", "tcpin:127.0.0.1:5760"),
        ("tcpin:[::1]:5760", "tcpin: waits for connections on [::1]:5760", "tcp:[::1]:5760"),
        ("/dev/ttyUSB0", "serial: opens /dev/ttyUSB0 at 57600 baud", "baud rate"),
    ],
)
def test_the_direction_is_said_and_the_other_one_named(text: str, sentence: str, other: str) -> None:
    assert parse_url(text).understood() == sentence
    assert other in parse_url(text).other_direction()


@pytest.mark.parametrize(
    "text",
    [
        "", "udp", "udp:", "udpout:", "udpout::14560", "udpout:127.0.0.1", "udpout:127.0.0.1:", "udpout:127.0.0.1:x",
        "udpout:127.0.0.1:70000", "udpout:127.0.0.1:0", "udpout:127.0.0.1:-1", "udpout:127.0.0.1:14560:1",
        "udpout:127.0.0.1:14560,", "udpout:127.0.0.1:14560,x", "udpout:127.0.0.1:14560,70000", "udpin:0.0.0.0:14550,1",
        "tcp:127.0.0.1:5760,1",
        "127.0.0.1:14550", "http://example.com", "udpbcast:10.0.0.255:14550", "tcp:::1:5760", "udpin:[::1:14550",
        "udpin://host/path:1", "/dev/ttyUSB0,fast", "/dev/ttyUSB0,0", "/dev/ttyUSB0,-5", "COM", "serial:", "serial://",
        "serial:/dev/ttyUSB0:99999999999", "udpin:127.0.0.1:١٤", "tcp:a b:5760",
    ],
)  # fmt: skip
def test_what_is_no_link_is_refused_with_the_forms_there_are(text: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_url(text)
    assert "udpin:HOST:PORT" in str(refused.value)
    assert "udpout:HOST:PORT" in str(refused.value)
    assert "/dev/ttyUSB0,57600" in str(refused.value)


def test_the_port_to_send_from_depends_on_the_place_alone() -> None:
    fleet = [parse_url(f"udpout:127.0.0.1:{18570 + n}").sends_from for n in range(100)]
    assert len(set(fleet)) == 100
    assert fleet == [parse_url(f"udpout://127.0.0.1:{18570 + n}").sends_from for n in range(100)]
    assert all(20_000 <= port < 32_768 for port in fleet)
    assert parse_url("udpout:127.0.0.1:18570,14551").sends_from == 14551


def test_mavsdks_udp_to_a_far_host_may_mean_either_direction() -> None:
    with pytest.raises(InputError, match=r"udpin://10\.0\.0\.7:14540 or udpout://10\.0\.0\.7:14540"):
        parse_url("udp://10.0.0.7:14540")


def test_a_very_long_link_is_not_repeated_whole() -> None:
    with pytest.raises(InputError) as refused:
        parse_url("udpout:" + "x" * 10_000)
    assert len(str(refused.value)) < 600


@pytest.mark.slow
@settings(max_examples=draws(500))
@given(
    st.one_of(
        st.text(max_size=60),
        st.tuples(
            st.sampled_from(["udp", "udpin", "udpout", "tcp", "tcpin", "serial", "COM", "/dev/tty", "ftp"]),
            st.sampled_from(["", ":", "://", ",", "::"]),
            st.text("0123456789abc.:[]/,-% \u0661é", max_size=30),
        ).map("".join),
    )
)
def test_whatever_is_written_it_is_understood_or_refused(text: str) -> None:
    try:
        endpoint = parse_url(text)
    except InputError:
        return
    assert parse_url(endpoint.url) == endpoint
    assert 0 <= endpoint.port <= 65535
    assert endpoint.understood()
    assert endpoint.other_direction()
