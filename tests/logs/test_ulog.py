"""PX4's logs: estimator or receiver, one battery or more, and what says that a log is none or lacks something."""

from __future__ import annotations

import struct
import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.logs.fit import fit_energy
from gcsplan.logs.ulog import read_ulog
from tests.support.attacks import require_placed_words
from tests.support.flight_logs import ULOG_TOPICS, ulog, ulog_rows, within


@pytest.mark.parametrize(("batteries", "gps"), [(1, False), (2, False), (1, True)])
def test_a_px4_log_gives_the_energies_that_were_flown(tmp_path: Path, batteries: int, gps: bool) -> None:
    log = read_ulog(ulog(tmp_path / "a.ulg", ulog_rows(batteries, gps=gps)))
    found = fit_energy([log])
    assert within(found), found.yaml()
    assert ("places were taken, vehicle_gps_position" in "".join(map(str, log.notes))) is gps


def test_the_wind_of_a_px4_log_is_the_velocity_of_the_air(tmp_path: Path) -> None:
    rows = [*ulog_rows(), *(("wind", 0, (k * 1_000_000, 2.0, -3.0)) for k in range(200))]
    wind = read_ulog(ulog(tmp_path / "a.ulg", rows)).wind
    assert wind[5].tolist() == [5.0, -3.0, 2.0]


@pytest.mark.parametrize(
    ("keep", "words"),
    [
        (
            lambda row: row[0] != "battery_status",
            "holds no battery current: it needs battery_status with voltage_v and",
        ),
        (lambda row: row[0] == "battery_status", "holds no places .vehicle_global_position or sensor_gps"),
        (lambda row: False, "holds no places"),
    ],
)
def test_what_a_px4_log_lacks_is_named(tmp_path: Path, keep: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_ulog(ulog(tmp_path / "a.ulg", [row for row in ulog_rows() if keep(row)]))


def test_a_column_that_a_px4_log_lacks_is_named(tmp_path: Path) -> None:
    topics = ULOG_TOPICS | {"battery_status": ("float voltage_v;float current_b;bool connected", "<Qff?")}
    with pytest.raises(InputError, match="no battery current; battery_status has no current_a"):
        read_ulog(ulog(tmp_path / "a.ulg", ulog_rows(), topics))


@pytest.mark.nightly
def test_a_current_that_is_unknown_or_in_hundredths_is_no_power(tmp_path: Path) -> None:
    def changed(amp: Any) -> Path:
        rows = [
            (name, k, (v[0], v[1], amp(v[2]), v[3]) if name == "battery_status" else v) for name, k, v in ulog_rows()
        ]
        return ulog(tmp_path / "a.ulg", rows)

    with pytest.raises(InputError, match="its current_a is never above 0"):
        read_ulog(changed(lambda amp: -1.0))
    with pytest.raises(InputError, match="in another unit, such as hundredths or thousandths"):
        read_ulog(changed(lambda amp: 100.0 * amp))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"ULog", "is no PX4 log"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "holds no places"),
        (b"ULog\x01\x12\x35\x01" + bytes(8) + struct.pack("<HB", 6, ord("B")) + b"xyz", "damaged|no places"),
    ],
)
def test_a_file_that_is_no_px4_log_says_so(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "a.ulg").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_ulog(tmp_path / "a.ulg")


@pytest.mark.parametrize("fields", ["many[600] x", "float[999999999] x", "float[60000] x", "battery_status[2] x"])
def test_a_message_of_very_many_numbers_is_refused_before_it_is_read(tmp_path: Path, fields: str) -> None:
    topics = ULOG_TOPICS | {"battery_status": (fields, "<Q"), "many": ("more[60000] y", "<Q")}
    with pytest.raises(InputError, match="its battery_status has more than 10000 numbers: it is damaged"):
        read_ulog(ulog(tmp_path / "a.ulg", [], topics))


@pytest.mark.nightly
def test_damage_within_a_px4_log_ends_in_a_fit_or_a_message(tmp_path: Path) -> None:
    whole = ulog(tmp_path / "a.ulg", ulog_rows()).read_bytes()
    for at in range(300, len(whole), len(whole) // 12):
        (tmp_path / "a.ulg").write_bytes(whole[:at] + b"\xff" * 60 + whole[at + 60 :])
        try:
            assert len(read_ulog(tmp_path / "a.ulg").place_s)
        except InputError as why:
            require_placed_words(why)


def test_without_pyulog_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(InputError, match=r"which is not there: pip install 'gcsplan\[logs\]'"):
        read_ulog(ulog(tmp_path / "a.ulg", []))
