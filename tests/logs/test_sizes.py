"""Logs of every kind are bounded before the work is done, in readings, messages, lines and bytes."""

from __future__ import annotations

import random
import struct
import time
from pathlib import Path

import pytest
from pymavlink.DFReader import DFReader_binary

from gcsplan.errors import InputError
from gcsplan.logs import csv_log, dataflash, flight_log, reader, tlog
from gcsplan.logs.reader import read_log
from tests.support import flight_logs as flights

HEADER = "time_s,lat,lon,alt_m,power_w\n"


def refused(file: Path) -> str:
    with pytest.raises(InputError) as refusal:
        read_log(file)
    return str(refusal.value)


@pytest.mark.parametrize("name", ["log.csv", "log.bin", "log.tlog"])
def test_a_log_is_refused_by_its_size_before_it_is_read(name: str, tmp_path: Path) -> None:
    with (tmp_path / name).open("wb") as file:
        file.truncate(reader.MOST_LOG_BYTES + 1)  # a hole: no byte of it is on the disk
    assert "has more than 256 MB; cut it to the flight" in refused(tmp_path / name)


@pytest.mark.nightly
def test_readings_of_an_ardupilot_log_are_counted_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = flights.dataflash(tmp_path / "log.bin", flights.dataflash_rows())
    rows = len(flights.dataflash_rows())
    monkeypatch.setattr(dataflash, "MOST_READINGS", rows)
    read_log(file)
    monkeypatch.setattr(dataflash, "MOST_READINGS", rows - 1)
    monkeypatch.setattr(DFReader_binary, "recv_match", lambda *_, **__: pytest.fail("it was read"))
    assert "readings of place, battery and wind; cut it to the flight" in refused(file)


@pytest.mark.nightly
def test_records_of_an_ardupilot_log_are_counted_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """250 MB of heads without a body took 4 GB."""
    file = flights.dataflash(tmp_path / "log.bin", flights.dataflash_rows())
    records = len(flights.dataflash_rows()) + 1 + len(flights.FORMATS)
    monkeypatch.setattr(dataflash, "MOST_RECORDS", records)
    read_log(file)
    damaged = tmp_path / "damaged.bin"
    damaged.write_bytes(file.read_bytes() + random.Random(1).randbytes(50_000).replace(b"\xa3\x95", b"") + bytes(100))
    read_log(damaged)
    monkeypatch.setattr(dataflash, "MOST_RECORDS", records - 1 - 5)  # the last bytes are not walked through
    monkeypatch.setattr("pymavlink.DFReader.DFReader_binary.__init__", lambda *_: pytest.fail("it was read"))
    assert "records; cut it to the flight, or give its parts as several logs" in refused(file)


@pytest.mark.nightly
def test_readings_are_counted_as_they_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = flights.tlog(tmp_path / "log.tlog")
    monkeypatch.setattr(flight_log, "MOST_READINGS", 500)
    assert "holds more than 500 readings" in refused(file)


@pytest.mark.nightly
def test_messages_of_a_ground_station_s_log_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = flights.tlog(tmp_path / "log.tlog")
    monkeypatch.setattr(tlog, "MOST_MESSAGES", 500)
    assert "holds more than 500 messages, or is damaged; cut it to the flight (mavlogdump.py" in refused(file)


def test_lines_of_a_csv_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "log.csv"
    rows = [f"{k},{46 + 1e-4 * k},14,{100 + k},300\n" for k in range(99)]
    file.write_text(HEADER + "".join(rows))
    monkeypatch.setattr(csv_log, "MOST_CSV_LINES", 100)
    read_log(file)
    monkeypatch.setattr(csv_log, "MOST_CSV_LINES", 99)
    assert "has more than 99 lines; cut it to the flight, or to every tenth line" in refused(file)


@pytest.mark.parametrize(
    "text", ["," * 200_000, HEADER + "1" * 200_000, HEADER + ('"' + "1\n" * 200_000)], ids=["head", "row", "quote"]
)
def test_a_line_without_an_end_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text)
    said = refused(tmp_path / "log.csv")
    assert "has more than 100000 characters" in said or "is no CSV" in said


@pytest.mark.nightly_but("log.bin-unknown", "log.bin-zeros", "log.bin-noise")
@pytest.mark.first_quick
@pytest.mark.parametrize("kind", ["noise", "unknown", "zeros"])
@pytest.mark.parametrize("name", ["log.bin", "log.tlog"])
def test_damage_is_bounded_in_time_and_leaves_nothing_behind(name: str, kind: str, tmp_path: Path) -> None:
    """Pymavlink complains of each byte that it cannot read, and looks for a clock at each."""
    good = flights.dataflash(tmp_path / "log.bin", flights.dataflash_rows()[:200]).read_bytes()
    if name == "log.tlog":
        good = flights.tlog(tmp_path / "log.tlog").read_bytes()[:20_000]
    bad = {"noise": random.Random(1).randbytes(200_000), "unknown": b"\xa3\x95\x99" * 60_000, "zeros": bytes(200_000)}[
        kind
    ]
    (tmp_path / name).write_bytes(good + bad)
    before, begun = len(list(Path("/proc/self/fd").glob("*"))) if Path("/proc").is_dir() else 0, time.process_time()
    try:
        read_log(tmp_path / name)
    except InputError as refusal:
        assert str(tmp_path / name) in str(refusal)  # noqa: PT017
    assert time.process_time() - begun < 5.0
    if before:
        assert len(list(Path("/proc/self/fd").glob("*"))) == before


def test_damage_that_pymavlink_tells_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "log.bin"
    head = b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    monkeypatch.setenv("PYMAVLINK_FAST_INDEX", "0")
    # In one of ten such noises a false message hides the damage from pymavlink; not in this one.
    file.write_bytes(head + random.Random(1).randbytes(100_000))
    assert "10000 places are damaged" in refused(file)
