"""The command line among strangers: spoilt files, garbage on the link, odd names, closed pipes, Ctrl-C.

Whatever comes in, what goes out is an exit code of the contract, one message, one JSON document if asked, and whole
files or none. The mutations are drawn from fixed seeds.
"""

from __future__ import annotations

import functools
import json
import random
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.output import files as outputs
from gcsplan.app.upload import run as uploads
from gcsplan.mavlink.files.formats import read_mission_file, write_plan
from gcsplan.mavlink.link.session import session
from gcsplan.mavlink.protocol.messages import Packet, Request
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.spoil import spoilt_bytes, spoilt_tree

pytestmark = pytest.mark.slow

CODES = {0, 2, 3, 4, 5, 6, 7}
JUDGED = {0, 4}  # of a check: safe; unsafe or not judged
MISSION = """
version: 1
terrain: {flat_m: 400}
limits: {min_agl_m: 30, horizontal_clearance_m: 10, track_error_m: 2, altitude_error_m: 2}
no_fly:
  - {name: mast, center: [36.598, -84.367], radius_m: 150, ceiling_agl_m: 200}
  - {name: field, polygon: [[36.61, -84.37], [36.62, -84.37], [36.62, -84.36]], floor_amsl_m: 450}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.6, -84.38], goal: [36.6, -84.37], via: [], end: land}
"""
ROWS = (
    "QGC WPL 110",
    "0\t1\t0\t16\t0\t0\t0\t0\t36.60000000\t-84.38000000\t400\t1",
    "1\t0\t3\t22\t0\t0\t0\t0\t36.60000000\t-84.38000000\t40\t1",
    "2\t0\t3\t16\t0\t0\t0\t0\t36.60000000\t-84.37500000\t40\t1",
    "3\t0\t3\t16\t0\t0\t0\t0\t36.60000000\t-84.37000000\t40\t1",
    "4\t0\t3\t21\t0\t0\t0\t0\t36.60000000\t-84.37000000\t0\t1",
)
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """`run` of the folder, in a directory with m.yaml and uav1.waypoints, where silence is soon taken for an answer."""
    monkeypatch.setattr(uploads, "LISTEN_S", 0.05)
    (tmp_path / "m.yaml").write_text(MISSION)
    (tmp_path / "uav1.waypoints").write_text("\n".join(ROWS) + "\n")
    return run


def require_civil(ended: tuple[int, str, str], what: object) -> int:
    """What every ``--json`` run owes: a code of the contract, one document, one message and nothing beside it."""
    code, out, err = ended
    assert code in CODES, (code, what, err)
    document = json.loads(out)
    assert ("error" in document) == (code != 0), what
    if code != 0:
        assert document["error"]["code"] == code
    if code == 2:
        assert err.startswith("gcsplan: "), (what, err)
    assert "Traceback" not in err
    assert "Warning" not in err, (what, err)
    return code


def ends(codes: set[int]) -> set[str]:
    """How checks ended: ``judged`` (safe, unsafe or not judged), ``refused`` as an input, or in another code."""
    return {"judged" if code in JUDGED else "refused" if code == 2 else str(code) for code in codes}


def test_spoilt_mission_files_end_in_a_message(run: Run, tmp_path: Path) -> None:
    rng, whole, codes = random.Random(1), yaml.safe_load(MISSION), set[int]()
    words = (
        b"&a ",
        b"*a",
        b"<<: ",
        b"!!python/object:os.system ",
        b": ",
        b"- ",
        b"{",
        b".nan",
        b"1e999",
        b"\t",
        b"\xff",
    )
    for i in range(60):
        tree, text = spoilt_tree(whole, rng), spoilt_bytes(MISSION.encode(), rng, words)
        data = yaml.safe_dump(tree).encode() if i % 3 else text
        (tmp_path / "m.yaml").write_bytes(data)
        codes.add(require_civil(run("check", "m.yaml", "uav1=uav1.waypoints", "--json"), data))
    assert ends(codes) == {"judged", "refused"}


@pytest.mark.nightly
def test_spoilt_waypoints_and_plans_end_in_a_message(run: Run, tmp_path: Path) -> None:
    rng, codes = random.Random(2), set[int]()
    plain = (tmp_path / "uav1.waypoints").read_bytes()
    plan = json.loads(write_plan(read_mission_file("uav1.waypoints", autopilot=Autopilot.ARDUCOPTER).mission))
    numbers = tuple(
        w.encode() for w in ("nan", "-inf", "1e39", "-1e308", "177", "82", "22", "16", "-1", "65536", "\t", "\n")
    )
    for i in range(80):
        if i % 2:
            name, data = "uav1.waypoints", spoilt_bytes(plain, rng, numbers)
        else:
            name, data = "uav1.plan", json.dumps(spoilt_tree(plan, rng)).encode()
        (tmp_path / name).write_bytes(data)
        codes.add(require_civil(run("check", "m.yaml", name, "--json"), data))
    assert ends(codes) == {"judged", "refused"}


def test_spoilt_zone_files_end_in_a_message(run: Run, tmp_path: Path) -> None:
    rng, codes = random.Random(3), set[int]()
    ring = [[-84.37, 36.62], [-84.36, 36.62], [-84.36, 36.63], [-84.37, 36.62]]
    zone = {"type": "Feature", "properties": {"name": "a", "ceiling_agl_m": 90}}
    point = {
        "type": "Feature",
        "properties": {"radius_m": 90},
        "geometry": {"type": "Point", "coordinates": [-84.37, 36.6]},
    }
    geojson = {
        "type": "FeatureCollection",
        "features": [zone | {"geometry": {"type": "Polygon", "coordinates": [ring]}}, point],
    }
    kml = (
        b"<kml><Document><Placemark><name>a</name><ExtendedData><Data name='radius_m'><value>90</value></Data>"
        b"</ExtendedData><Point><coordinates>-84.37,36.62</coordinates></Point></Placemark></Document></kml>"
    )
    words = (
        b"<!DOCTYPE a [<!ENTITY x 'y'>]>",
        b"&x;",
        b"<Polygon>",
        b"nan",
        b"1e400",
        b"91,181",
        b"<![CDATA[",
        b"\x00",
    )
    for i in range(50):
        name = "z.kml" if i % 2 else "z.geojson"
        data = spoilt_bytes(kml, rng, words) if i % 2 else json.dumps(spoilt_tree(geojson, rng)).encode()
        (tmp_path / name).write_bytes(data)
        (tmp_path / "m.yaml").write_text(MISSION.replace("no_fly:", f"no_fly:\n  - {{file: {name}}}"))
        codes.add(require_civil(run("check", "m.yaml", "uav1.waypoints", "--json"), data))
    assert ends(codes) == {"judged", "refused"}


def test_spoilt_terrain_ends_in_a_message(run: Run, tmp_path: Path) -> None:
    rng, codes = random.Random(4), set[int]()
    heights = "\n".join(" ".join("400" for _ in range(60)) for _ in range(60))
    header = b"ncols 60\nnrows 60\nxllcorner -84.41\nyllcorner 36.57\ncellsize 0.001\nNODATA_value -9999\n"
    words = (b"ncols 2147483647", b"nrows 99999999", b"-1", b"nan", b"1e400", b"cellsize 0", b"\x00")
    tile = np.full((1201, 1201), 400, ">i2").tobytes()
    dem = "{dem: %s, vertical_datum: EGM96, crs: EPSG:4326}"
    for i in range(24):
        name = "N36W085.hgt" if i % 6 == 0 else "g.asc"
        data = rng.choice((tile[:-1], tile[:99], tile * 2)) if i % 6 == 0 else spoilt_bytes(header, rng, words)
        (tmp_path / name).write_bytes(data + (b"" if i % 6 == 0 else heights.encode()))
        (tmp_path / "m.yaml").write_text(MISSION.replace("{flat_m: 400}", dem % name))
        codes.add(require_civil(run("check", "m.yaml", "uav1.waypoints", "--json"), data))
    assert ends(codes) == {"judged", "refused"}


class Meddler(threading.Thread):
    """Between gcsplan and a vehicle: passes datagrams on, spoils some, and throws in frames of its own."""

    def __init__(self, vehicle: tuple[str, int], rng: random.Random) -> None:
        super().__init__(daemon=True)
        self.rng = rng
        self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.front.bind(("127.0.0.1", 0))
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.back.connect(vehicle)
        for end in (self.front, self.back):
            end.settimeout(0.005)
        self.url = f"udpout:127.0.0.1:{self.front.getsockname()[1]}"
        self.over = threading.Event()

    def run(self) -> None:
        caller: Any = None
        while not self.over.is_set():
            for end in (self.front, self.back):
                try:
                    data, sender = end.recvfrom(4096)
                except OSError:
                    continue
                if end is self.front:
                    caller = sender
                    self.back.send(data)
                elif caller is not None:
                    for frame in (*self.junk(data), data):
                        self.front.sendto(frame, caller)
        self.front.close()
        self.back.close()

    def junk(self, data: bytes) -> list[bytes]:
        """Now and then: noise, or the answer spoilt, or the same from a foreign system or cut short."""
        kind = self.rng.random()
        if kind < 0.6:
            return []
        foreign = bytearray(data)
        foreign[5] = 77  # the sender's system id; the checksum is wrong now as well
        return [self.rng.choice((self.rng.randbytes(40), spoilt_bytes(data, self.rng), bytes(foreign), data[:9], data))]


def test_garbage_on_the_link_neither_crashes_nor_passes_for_the_truth(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "SessionOptions", functools.partial(session.SessionOptions, discover_s=3.0))
    for seed in range(2):
        craft = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=400.0)
        with SimServer([craft], "udpin:127.0.0.1:0") as server:
            meddler = Meddler(server.address, random.Random(seed))
            meddler.start()
            try:
                ended = run("upload", "uav1.waypoints", "--to", meddler.url, "--mission", "m.yaml", "--json")
                require_civil(ended, seed)
                if ended[0] == 0:  # said to be verified: then it is on board
                    assert [i.command for i in craft.items()] == [16, 22, 16, 16, 21]
                require_civil(run("download", "--from", meddler.url, "-o", "back.plan", "--json"), seed)
                require_civil(run("clear", "--to", meddler.url, "--json"), seed)
            finally:
                meddler.over.set()
                meddler.join(5.0)
    assert not [p.name for p in tmp_path.iterdir() if p.name.startswith(".")]


# -- names, streams and Ctrl-C ----------------------------------------------------------------------------------------


def test_ctrl_c_during_an_upload_says_what_is_unknown_now(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(uploads, "run_jobs", interrupted)
    code, out, err = run("upload", "uav1.waypoints", "--to", "sim", "--mission", "m.yaml", "--json")
    assert code == 130
    assert "its mission is now unknown" in err
    assert "uav1" in json.loads(out)["error"]["message"]


# -- outputs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "slip",
    [("--planner", "optimol"), ("--objective", "speed"), ("--upload", "udpp:x"), ("--upload", ""), ("--png", "x.gif")],
)
def test_a_slip_on_the_command_line_leaves_earlier_outputs_alone(
    run: Run, tmp_path: Path, slip: tuple[str, str]
) -> None:
    assert run("plan", "m.yaml", "-o", "out")[0] == 0
    assert run("plan", "m.yaml", "-o", "out", *slip)[0] == 2
    assert (tmp_path / "out" / "uav1.plan").exists()
    assert not (tmp_path / "out" / "previous").exists()


def test_a_file_of_others_that_is_moved_aside_is_named(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "uav1.plan").write_text("mine")
    code, _, err = run("plan", "m.yaml", "-o", "out")
    assert code == 0
    assert "uav1.plan" in err.splitlines()[0]
    assert (tmp_path / "out" / "previous" / "uav1.plan").read_text() == "mine"


def test_a_picture_beside_a_plan_goes_with_it(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("plan", "m.yaml", "-o", "out", "--png", "out/map.png")[0] == 0
    (tmp_path / "m.yaml").write_text(MISSION.replace("min_agl_m: 30", "min_agl_m: 900, max_agl_m: 100"))
    assert run("plan", "m.yaml", "-o", "out")[0] in (2, 3)
    assert not (out / "map.png").exists()
    assert (out / "previous" / "map.png").exists()


def test_why_there_is_no_mission_is_told_even_where_the_old_one_cannot_be_moved(run: Run, tmp_path: Path) -> None:
    assert run("plan", "m.yaml", "-o", "out")[0] == 0
    (tmp_path / "out" / "previous").write_text("mine")
    (tmp_path / "m.yaml").write_text(MISSION.replace("min_agl_m: 30", "min_agl_m: 900, max_agl_m: 100"))
    code, _, err = run("plan", "m.yaml", "-o", "out")
    assert code in (2, 3)
    assert "agl" in err
    assert "are still in out" in err
    assert (tmp_path / "out" / "uav1.plan").exists()


def test_a_picture_that_cannot_be_drawn_stops_before_anything_is_written(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> bytes:
        raise ValueError("no fonts")

    assert run("plan", "m.yaml", "-o", "out", "--png", "nowhere/x.png")[0] == 2
    monkeypatch.setattr(outputs, "picture_of", broken)
    assert run("plan", "m.yaml", "-o", "out", "--png", "x.png")[0] == 70
    assert not (tmp_path / "out").exists()


# -- who gets what ----------------------------------------------------------------------------------------------------


def test_upload_needs_one_file_and_one_number_for_each_vehicle(run: Run, tmp_path: Path) -> None:
    (tmp_path / "b.waypoints").write_text((tmp_path / "uav1.waypoints").read_text())
    to = ("--to", "sim", "--mission", "m.yaml")
    for arguments, word in (
        (("uav1.waypoints", *to, "--sysid", "9"), "--sysid"),
        (("uav1.waypoints", "uav1=b.waypoints", *to), "both for uav1"),
        (("uav1.waypoints", "b.waypoints", "--to", "udpout:127.0.0.1:9", "--unchecked"), "one FILE"),
        (("uav1.waypoints", "--to", "Sim", "--mission", "m.yaml"), "did you mean sim?"),
        (("uav1.waypoints", "--to", "link", "--mission", "m.yaml"), "link"),
    ):
        code, _, err = run("upload", *arguments)
        assert code == 2, arguments
        assert word in err
    assert run("upload", "uav1.waypoints", *to)[0] == 0
    assert run("sim", "m.yaml", "--sysid", "3")[0] == 2


def test_a_missing_file_is_told_before_a_vehicle_is_looked_for(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(*_: object, **__: object) -> None:
        raise AssertionError("the link was opened")

    monkeypatch.setattr(uploads, "open_link", opened)
    for command in ("verify", "upload"):
        more = ["--unchecked"] if command == "upload" else []
        code, _, err = run(command, "nowhere.waypoints", "--to", "udpout:127.0.0.1:9", *more)
        assert code == 2
        assert "there is no such file" in err
    assert run("download", "--from", "udpout:127.0.0.1:9", "-o", "nowhere/x.plan")[0] == 2


@pytest.mark.parametrize(
    ("trouble", "code", "reason"),
    [({"armed": True}, 5, "armed"), ({"corrupt": 3}, 7, "differs"), ({"refuse": 2}, 5, "refused")],
)
def test_json_of_a_failed_upload_has_both_the_error_and_the_upload(
    run: Run, trouble: dict[str, Any], code: int, reason: str
) -> None:
    craft = LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=400.0, misbehave=Misbehaviour(**trouble)
    )
    with SimServer([craft], "udpin:127.0.0.1:0") as server:
        got, out, _ = run("upload", "uav1.waypoints", "--to", server.url_for_gcs, "--mission", "m.yaml", "--json")
    document = json.loads(out)
    assert got == code == document["error"]["code"]
    assert document["error"]["reason"] == reason
    assert document["error"]["message"]
    assert document["vehicles"][0]["verified"] is False


def test_json_of_a_mission_on_board_of_a_vehicle_that_was_armed_meanwhile(run: Run) -> None:
    class Armed(LoopbackVehicle):
        def receive(self, packet: Packet, now: float) -> list[Packet]:
            if isinstance(packet.message, Request) and packet.message.seq == len(self.items()) - 1:
                self.armed = True  # while the last item is read back
            return super().receive(packet, now)

    words = ("--mission", "m.yaml", "--json", "--timeout", "30")
    for allowed in (False, True):
        craft = Armed(1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=400.0)
        with SimServer([craft], "udpin:127.0.0.1:0") as server:
            flag = ("--allow-armed",) if allowed else ()
            got, out, _ = run("upload", "uav1.waypoints", "--to", server.url_for_gcs, *words, *flag)
        document = json.loads(out)
        told = document["vehicles"][0]
        assert (told["outcome"], told["verified"]) == ("accepted", True)
        if allowed:
            assert got == 0
            continue
        assert got == document["error"]["code"] == 5
        assert told["changed"] == document["error"]["reason"] == "armed"
        assert "the new mission IS on board" in document["error"]["message"]


def test_json_of_a_failed_check_has_the_error_beside_the_verdict(run: Run, tmp_path: Path) -> None:
    low = (tmp_path / "uav1.waypoints").read_text().replace("\t40\t1\n3", "\t20\t1\n3")
    (tmp_path / "uav1.waypoints").write_text(low)
    code, out, _ = run("check", "m.yaml", "uav1.waypoints", "--json")
    document = json.loads(out)
    assert code == document["error"]["code"] == 4
    assert document["error"]["reason"] == "violation"
    assert document["verdicts"][0]["safe"] is False


# -- help -------------------------------------------------------------------------------------------------------------
