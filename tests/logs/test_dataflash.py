"""ArduPilot's onboard logs: one battery or more, damage, and the old hundredths."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.logs.dataflash import read_dataflash
from gcsplan.logs.fit import fit_energy
from tests.support.flight_logs import FORMATS, dataflash, dataflash_rows, degrees, flown, within


@pytest.mark.slow
def test_an_ardupilot_log_with_one_battery_or_two(tmp_path: Path) -> None:
    for batteries in (1, 2):
        file = dataflash(tmp_path / f"{batteries}.bin", dataflash_rows(batteries))
        found = fit_energy([read_dataflash(file)])
        assert within(found), found.yaml()


@pytest.mark.slow
def test_an_ardupilot_log_without_a_battery_or_cut_short_or_damaged(tmp_path: Path) -> None:
    rows = dataflash_rows()
    with pytest.raises(InputError, match="no battery current"):
        read_dataflash(dataflash(tmp_path / "a.bin", [r for r in rows if r[0] == "POS"]))
    with pytest.raises(InputError, match="no places"):
        read_dataflash(dataflash(tmp_path / "b.bin", [r for r in rows if r[0] == "BAT"]))
    whole = dataflash(tmp_path / "c.bin", rows).read_bytes()
    (tmp_path / "c.bin").write_bytes(whole[: len(whole) - 5])
    assert within(fit_energy([read_dataflash(tmp_path / "c.bin")]))
    (tmp_path / "d.bin").write_bytes(whole[:200])
    with pytest.raises(InputError):
        read_dataflash(tmp_path / "d.bin")
    hurt = whole[:5000] + b"\x00" * 300 + whole[5300:]
    (tmp_path / "e.bin").write_bytes(hurt)
    assert within(fit_energy([read_dataflash(tmp_path / "e.bin")]), 0.03)


OLD = {
    "CURR": (131, "IhhhhH", "TimeMS,ThrOut,Volt,Curr,Vcc,CurrTot", "<IhhhhH"),
    "GPS": (132, "BIHBcLLeeI", "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,T", "<BIHBhiiiiI"),
}


def old_rows() -> list[tuple[str, tuple[float, ...]]]:
    """A log of ArduCopter 3.2: milliseconds, hundredths, and a GPS whose TimeMS is the time of the week."""
    t, place, watts = flown(seed=26)
    lat, lon = degrees(place)
    rows: list[tuple[str, tuple[float, ...]]] = []
    for i, s in enumerate(t):
        ms, up = int(s * 1e3) + 1, round((300 + place[i, 2]) * 100)
        fix = (3, 345_600_000 + ms, 1800, 9, 120, round(lat[i] * 1e7), round(lon[i] * 1e7), up - 30_000, up, ms)
        rows += [("GPS", fix), ("CURR", (ms, 500, 2200, min(round(watts[i] / 22.0 * 100), 32767), 5000, 0))]
    return rows


@pytest.mark.slow
def test_a_log_of_milliseconds_and_hundredths_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, row in OLD.items():
        monkeypatch.setitem(FORMATS, name, row)
    found = fit_energy([read_dataflash(dataflash(tmp_path / "old.bin", old_rows()))])
    assert within(found), found.yaml()


@pytest.mark.parametrize(
    ("kind", "old", "new", "words"),
    [
        ("CURR", "Curr,", "Amps,", "no battery current .*; CURR has no Curr"),
        ("CURR", "TimeMS,", "Tick,", "no battery current .*; CURR has no TimeUS"),
        ("GPS", "Lng,", "X,", "no places .*; GPS has no Lng"),
        ("GPS", ",T", ",Q", "no places .*; GPS has no TimeUS"),
    ],
)
def test_a_column_that_a_log_lacks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, old: str, new: str, words: str
) -> None:
    for name, (number, form, columns, packed) in OLD.items():
        monkeypatch.setitem(
            FORMATS, name, (number, form, columns.replace(old, new) if name == kind else columns, packed)
        )
    with pytest.raises(InputError, match=words):
        read_dataflash(dataflash(tmp_path / "old.bin", old_rows()[:100]))


@pytest.mark.nightly
def test_an_old_log_s_hundredths_are_read_by_its_own_format(tmp_path: Path) -> None:
    t, place, watts = flown(seed=26)
    lat, lon = degrees(place)
    old = {"CURR": (131, "Qhhh", "TimeUS,Throttle,Volt,Curr", "<Qhhh")}
    FORMATS.update(old)
    try:
        rows: list[tuple[str, tuple[float, ...]]] = []
        for i, s in enumerate(t):
            us = int(s * 1e6) + 1
            rows.append(("POS", (us, round(lat[i] * 1e7), round(lon[i] * 1e7), 300 + place[i, 2], place[i, 2])))
            rows.append(("CURR", (us, 500, 2200, min(round(watts[i] / 22.0 * 100), 32767))))
        found = fit_energy([read_dataflash(dataflash(tmp_path / "old.bin", rows))])
    finally:
        FORMATS.pop("CURR")
    assert within(found), found.yaml()
