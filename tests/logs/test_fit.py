"""Logs into R1, R2 and hover power: found again from flights that were made with them, and not claimed where unseen."""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from typer.testing import CliRunner

from gcsplan.arrays import Floats
from gcsplan.cli.energy import fit_energy as command
from gcsplan.errors import InputError, UsageError
from gcsplan.logs.fit import EnergyFit, fit_energy
from gcsplan.logs.flight_log import FlightLog
from gcsplan.logs.reader import read_log

R1, R2, HOVER = 120.0, 100.0, 400.0
LAT, LON = 36.6, -84.38

Leg = tuple[float, float, float, float]
"""Metres east, north and up, and seconds that it takes."""

MISSION: tuple[Leg, ...] = (
    (0, 0, 60, 30), (0, 0, 0, 40), (900, 0, 0, 90), (500, 300, 100, 60), (0, 0, 0, 30),
    (600, -400, 0, 70), (300, 0, -80, 55), (800, 0, 0, 80), (0, 0, 0, 30), (200, 0, 60, 30), (0, 0, -138, 92),
)  # fmt: skip


def flown(
    legs: Sequence[Leg] = MISSION, *, seed: int = 1, noise: float = 0.05, hz: float = 5.0,
    cost: Callable[[float, float, bool], float] | None = None,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Seconds (N,), places (N, 3) with the noise of a receiver, watts (N,) with ``noise`` of theirs."""
    rng = np.random.default_rng(seed)
    knots, at = [np.zeros(3)], [0.0]
    for e, n, u, s in legs:
        knots.append(knots[-1] + np.array([e, n, u]))
        at.append(at[-1] + s)
    t = np.arange(0.0, at[-1], 1.0 / hz)
    place = np.stack([np.interp(t, at, [k[i] for k in knots]) for i in range(3)], axis=-1)
    leg = np.minimum(np.searchsorted(at, t, side="right") - 1, len(legs) - 1)
    speed = np.array([(math.hypot(e, n) / s, abs(u) / s, not (e or n or u)) for e, n, u, s in legs])[leg]
    rule = cost or (lambda run, rise, still: R1 * rise + R2 * run + HOVER * still)
    watts = np.array([rule(float(run), float(rise), bool(still)) for run, rise, still in speed])
    watts *= 1.0 + noise * rng.standard_normal(len(t))
    return t, place + rng.normal(0.0, (0.15, 0.15, 0.1), place.shape), watts


def log_of(t: Floats, place: Floats, watts: Floats) -> FlightLog:
    return FlightLog("flight", t, place[:, 0], place[:, 1], 300.0 + place[:, 2], t, watts)


def within(found: EnergyFit, part: float = 0.02) -> bool:
    values = (found.vertical.value, found.horizontal.value, found.hover.value)
    return all(v is not None and abs(v - w) <= part * w for v, w in zip(values, (R1, R2, HOVER), strict=True))


def degrees(place: Floats) -> tuple[Floats, Floats]:
    """Latitude, longitude of places in metres, by the ellipsoid's radii there."""
    w = 1.0 - 6.694379990141e-3 * math.sin(math.radians(LAT)) ** 2
    north, east = 6_378_137.0 * (1 - 6.694379990141e-3) / w**1.5, 6_378_137.0 / math.sqrt(w)
    return LAT + np.degrees(place[:, 1] / north), LON + np.degrees(place[:, 0] / east / math.cos(math.radians(LAT)))


@pytest.mark.parametrize("seed", range(8))
def test_what_a_flight_was_made_with_is_found_within_two_percent_at_five_percent_noise(seed: int) -> None:
    found = fit_energy([log_of(*flown(seed=seed))])
    assert within(found)
    assert found.told
    for c, true in ((found.vertical, R1), (found.horizontal, R2), (found.hover, HOVER)):
        assert c.value is not None
        assert c.half_95 is not None
        assert 0.0 < c.half_95 < 0.05 * true


def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    held = 0
    for seed in range(40):
        c = fit_energy([log_of(*flown(seed=100 + seed, hz=1.0, noise=0.15))]).horizontal
        assert c.value is not None
        assert c.half_95 is not None
        held += abs(c.value - R2) <= c.half_95
    assert held >= 32


def test_gusts_and_dropouts_do_not_move_the_numbers() -> None:
    t, place, watts = flown(seed=3)
    rng = np.random.default_rng(3)
    for k in rng.integers(0, len(t) - 30, 12).tolist():
        watts[k : k + 25] *= rng.choice([0.05, 6.0])
    assert within(fit_energy([log_of(t, place, watts)]), 0.04)


def test_power_and_places_may_come_at_other_rates_and_with_pauses() -> None:
    t, place, watts = flown(seed=4, hz=10.0)
    keep = np.abs(t - 200.0) > 8.0
    slow = np.arange(len(t)) % 5 == 0
    log = FlightLog("f", t[keep], *place[keep].T, t[slow], watts[slow])
    assert within(fit_energy([log]))


def test_standing_on_the_ground_before_and_after_counts_for_nothing() -> None:
    t, place, watts = flown(seed=5)
    ground = np.zeros((600, 3)) + place[0] * [1, 1, 0]
    rest = np.full(600, 12.0)
    t = np.arange(len(t) + 1200) / 5.0
    place = np.vstack([ground, place, ground + place[-1] * [1, 1, 0]])
    assert within(fit_energy([log_of(t, place, np.concatenate([rest, watts, rest]))]))


def test_a_level_flight_tells_nothing_of_the_vertical() -> None:
    found = fit_energy([log_of(*flown([(0, 0, 10, 5), (0, 0, 0, 60), (4000, 0, 0, 400), (0, 0, 0, 60)]))])
    assert found.vertical.value is None
    assert "few" in found.vertical.why
    assert not found.told
    assert found.horizontal.value == pytest.approx(R2, rel=0.02)
    assert "# vertical_j_per_m" in found.yaml()
    assert "\n  horizontal_j_per_m: 1" in found.yaml()


def test_a_flight_that_always_climbs_alike_cannot_tell_up_from_along() -> None:
    legs: list[Leg] = [(300, 0, 60, 30), (300, 0, -60, 30)] * 8
    found = fit_energy([log_of(*flown(legs))])
    assert found.vertical.value is None
    assert found.horizontal.value is None
    assert "apart" in found.vertical.why
    assert "proportion" in found.horizontal.why


def test_two_flights_tell_what_neither_does_alone() -> None:
    slanted = log_of(*flown([(300, 0, 60, 30), (300, 0, -60, 30)] * 6))
    level = log_of(*flown([(0, 0, 10, 5), (4000, 0, 0, 400), (0, 0, 0, 40)], seed=2))
    assert not fit_energy([slanted]).told
    assert not fit_energy([level]).told
    both = fit_energy([slanted, level])
    assert both.vertical.value == pytest.approx(R1, rel=0.05)
    assert both.horizontal.value == pytest.approx(R2, rel=0.02)


def test_noise_as_large_as_the_effect_is_called_uncertain() -> None:
    legs: list[Leg] = [(0, 0, 75, 50), (3000, 0, 0, 300)]
    found = fit_energy([log_of(*flown(legs, noise=1.6, hz=1.0, seed=7))])
    assert found.vertical.value is None
    assert "uncertain" in found.vertical.why
    assert found.horizontal.value is not None  # sixty steps of it


def test_climbs_that_cost_more_than_descents_are_told() -> None:
    t, place, watts = flown(seed=8)
    up = np.gradient(place[:, 2], t)
    rising = np.interp(t, t[::25], np.sign(np.add.reduceat(up, np.arange(0, len(t), 25))))
    watts = watts + 60.0 * np.where(np.abs(up) > 0, rising, 0) * np.abs(
        np.gradient(np.interp(t, t[::50], place[::50, 2]), t)
    )
    assert any("a metre up costs about" in n for n in fit_energy([log_of(t, place, watts)]).notes)


# -- files ----------------------------------------------------------------------------------------------------------


def csv_of(path: Path, header: str, columns: Sequence[Floats], mark: str = ",") -> Path:
    rows = [header, *(mark.join(f"{v:.9f}" for v in row) for row in zip(*columns, strict=True))]
    path.write_text("\r\n".join(rows) + "\r\n", encoding="utf-8-sig")
    return path


def test_csv_in_degrees_or_metres_with_power_or_volt_and_amp(tmp_path: Path) -> None:
    t, place, watts = flown(seed=9)
    lat, lon = degrees(place)
    a = csv_of(tmp_path / "a.csv", "Time,Latitude,Longitude,Altitude,Voltage,Current",
               [t, lat, lon, place[:, 2] + 300, np.full(len(t), 22.2), watts / 22.2])  # fmt: skip
    b = csv_of(tmp_path / "b.csv", "time_s;x;y;z;my power", [t, *place.T, watts], ";")
    assert within(fit_energy([read_log(a)]))
    assert within(fit_energy([read_log(b, columns={"power_w": "my power"})]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("time_s,lat,lon,amsl_m\n1,2,3,4\n", "no column for power_w"),
        ("a,b\n1,2\n", "no column for time_s, amsl_m, lat and lon, power_w"),
        ("time_s,lat,lon,amsl_m,power_w\n" + "1,x,3,4,y\n" * 50, "50 lines without numbers, the first is line 2"),
        ("time_s,lat,lon,amsl_m,power_w\n1,2,3,4,5\n", "1 position,"),
    ],
)
def test_a_csv_that_cannot_be_used_says_what_it_lacks(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "x.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_log(file)


def test_files_that_are_none_say_so(tmp_path: Path) -> None:
    (tmp_path / "x.bin").write_bytes(b"hello, this is text")
    (tmp_path / "x.ulg").write_bytes(b"ULog")
    (tmp_path / "x.tlog").write_bytes(bytes(range(0, 128, 2)))
    for name, words in (
        ("gone.bin", "no such file"), ("x.bin", "A3 95"), ("x.ulg", "ulog2csv"), ("x.tlog", "no places|damaged"),
        (".", "folder"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            read_log(tmp_path / name)
    with pytest.raises(InputError, match="did you mean power_w"):
        read_log(csv_of(tmp_path / "y.csv", "a,b", [np.zeros(3)] * 2), columns={"power": "a"})


# A DataFlash log is messages behind A3 95: FMT (128) describes each type by its size, name, format and columns.
FORMATS = {
    "BAT": (129, "QBffff", "TimeUS,Inst,Volt,Curr,CurrTot,EnrgTot", "<QBffff"),
    "POS": (130, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", "<Qiiff"),
}


def dataflash(path: Path, rows: Sequence[tuple[str, tuple[float, ...]]]) -> Path:
    out = bytearray()

    def fmt(kind: int, size: int, name: str, form: str, columns: str) -> None:
        out.extend(
            b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, size, name.encode(), form.encode(), columns.encode())
        )

    fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    for name, (kind, form, columns, packed) in FORMATS.items():
        fmt(kind, 3 + struct.calcsize(packed), name, form, columns)
    for name, values in rows:
        kind, _, _, packed = FORMATS[name]
        out.extend(b"\xa3\x95" + bytes([kind]) + struct.pack(packed, *values))
    path.write_bytes(out)
    return path


def dataflash_rows(batteries: int = 1) -> list[tuple[str, tuple[float, ...]]]:
    t, place, watts = flown(seed=10)
    lat, lon = degrees(place)
    rows: list[tuple[str, tuple[float, ...]]] = []
    for i, s in enumerate(t):
        us = int(s * 1e6) + 1
        rows.append(("POS", (us, round(lat[i] * 1e7), round(lon[i] * 1e7), 300 + place[i, 2], place[i, 2])))
        for b in range(batteries):
            rows.append(("BAT", (us, b, 22.0, watts[i] / 22.0 / batteries, 0.0, 0.0)))
    return rows


def test_an_ardupilot_log_with_one_battery_or_two(tmp_path: Path) -> None:
    for batteries in (1, 2):
        file = dataflash(tmp_path / f"{batteries}.bin", dataflash_rows(batteries))
        found = fit_energy([read_log(file)])
        assert within(found), found.yaml()


def test_an_ardupilot_log_without_a_battery_or_cut_short_or_damaged(tmp_path: Path) -> None:
    rows = dataflash_rows()
    with pytest.raises(InputError, match="no battery current"):
        read_log(dataflash(tmp_path / "a.bin", [r for r in rows if r[0] == "POS"]))
    with pytest.raises(InputError, match="no places"):
        read_log(dataflash(tmp_path / "b.bin", [r for r in rows if r[0] == "BAT"]))
    whole = dataflash(tmp_path / "c.bin", rows).read_bytes()
    (tmp_path / "c.bin").write_bytes(whole[: len(whole) - 5])
    assert within(fit_energy([read_log(tmp_path / "c.bin")]))
    (tmp_path / "d.bin").write_bytes(whole[:200])
    with pytest.raises(InputError):
        read_log(tmp_path / "d.bin")
    hurt = whole[:5000] + b"\x00" * 300 + whole[5300:]
    (tmp_path / "e.bin").write_bytes(hurt)
    assert within(fit_energy([read_log(tmp_path / "e.bin")]), 0.03)


def tlog(path: Path, *, sysids: Sequence[int] = (1,), status: bool = False, battery: bool = True) -> Path:
    os.environ.setdefault("MAVLINK20", "1")
    import pymavlink.dialects.v20.ardupilotmega as dialect

    t, place, watts = flown(seed=11)
    lat, lon = degrees(place)
    out = bytearray()
    for sysid in sysids:
        link = dialect.MAVLink(None, srcSystem=sysid, srcComponent=1)
        for i, s in enumerate(t):
            stamp = struct.pack(">Q", int((1.7e9 + s) * 1e6))
            messages = [
                link.global_position_int_encode(
                    int(s * 1e3), round(lat[i] * 1e7), round(lon[i] * 1e7), round((300 + place[i, 2]) * 1e3),
                    round(place[i, 2] * 1e3), 0, 0, 0, 65535,
                )
            ]  # fmt: skip
            amp = round(watts[i] / 22.0 * 100)
            if battery and status:
                messages.append(link.sys_status_encode(0, 0, 0, 0, 22_000, amp, 50, 0, 0, 0, 0, 0, 0))
            elif battery:
                cells = [3667] * 6 + [65535] * 4
                messages.append(link.battery_status_encode(0, 0, 0, 32767, cells, amp, -1, -1, 50))
            for m in messages:
                out.extend(stamp + m.pack(link))
    path.write_bytes(out)
    return path


@pytest.mark.first_quick
@pytest.mark.parametrize("status", [False, True])
def test_a_ground_stations_log(tmp_path: Path, status: bool) -> None:
    log = read_log(tlog(tmp_path / "a.tlog", status=status))
    assert within(fit_energy([log]))
    assert bool(log.notes) is status


@pytest.mark.slow
def test_a_ground_stations_log_of_two_vehicles_or_without_a_battery(tmp_path: Path) -> None:
    two = tlog(tmp_path / "two.tlog", sysids=(1, 7))
    with pytest.raises(InputError, match=r"systems 1, 7.*--sysid"):
        read_log(two)
    assert within(fit_energy([read_log(two, sysid=7)]))
    with pytest.raises(InputError, match="holds 1, 7"):
        read_log(two, sysid=9)
    with pytest.raises(InputError, match="no battery current"):
        read_log(tlog(tmp_path / "none.tlog", battery=False))


# -- the command ----------------------------------------------------------------------------------------------------


def run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=True)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


def test_the_command_prints_what_is_to_be_pasted(tmp_path: Path) -> None:
    t, place, watts = flown(seed=12)
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,P", [t, *place.T, watts])
    code, text = run(str(file), "--csv-columns", "power_w=P")
    assert code == 0
    numbers = yaml.safe_load(text)["energy"]
    assert set(numbers) == {"vertical_j_per_m", "horizontal_j_per_m", "hover_w", "fitted_speed_m_s"}
    assert numbers["vertical_j_per_m"] == pytest.approx(R1, rel=0.02)
    with pytest.raises(UsageError, match="time_s=Time"):
        run(str(file), "--csv-columns", "power")


def test_the_command_ends_with_4_where_the_log_cannot_tell(tmp_path: Path) -> None:
    t, place, watts = flown([(0, 0, 10, 5), (3000, 0, 0, 300)])
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,power", [t, *place.T, watts])
    code, text = run(str(file), "--json")
    told = json.loads(text)
    assert code == 4
    assert told["error"]["code"] == 4
    assert "vertical_j_per_m" in told["error"]["message"]
    assert told["fit"]["vertical_j_per_m"]["value"] is None
    assert told["fit"]["horizontal_j_per_m"]["value"] == pytest.approx(R2, rel=0.02)


# -- time, speeds and wind --------------------------------------------------------------------------------------------

BASE, PER_M, UP = 300.0, 5.0, 40.0
TWO_SPEEDS: tuple[Leg, ...] = (
    (0, 0, 60, 30), (0, 0, 0, 40), (500, 0, 0, 100), (0, 500, 0, 100), (1400, 0, 0, 100), (0, -1400, 0, 100),
    (0, 0, -40, 25), (0, 0, 40, 20), (0, 0, 0, 40), (0, 0, -50, 30),
)  # fmt: skip


def timed(legs: Sequence[Leg], seed: int, wind: tuple[float, float] = (0.0, 0.0)) -> FlightLog:
    """A flight with a base power, in a wind that blows to the east and to the north."""
    t, place, _ = flown(legs, seed=seed)
    at = np.concatenate([[0.0], np.cumsum([leg[3] for leg in legs])])
    leg = np.minimum(np.searchsorted(at, t, side="right") - 1, len(legs) - 1)
    watts = np.array(
        [
            450.0 if not (e or n or u) else BASE + UP * abs(u) / s
            + PER_M * (math.hypot(e / s - wind[0], n / s - wind[1]) if e or n else 0.0)
            for e, n, u, s in legs
        ]
    )[leg]  # fmt: skip
    watts *= 1.0 + 0.03 * np.random.default_rng(seed).standard_normal(len(t))
    blows = np.column_stack([t, np.full(len(t), wind[0]), np.full(len(t), wind[1])]) if any(wind) else np.zeros((0, 3))
    return replace(log_of(t, place, watts), wind=blows)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (3.0, -2.0)])
def test_two_speeds_tell_the_base_power_and_one_does_not(wind: tuple[float, float]) -> None:
    found = fit_energy([timed(TWO_SPEEDS, 21, wind)])
    assert found.base.value == pytest.approx(BASE, rel=0.05)
    assert found.horizontal.value == pytest.approx(PER_M, abs=1.0)
    assert found.vertical.value == pytest.approx(UP, rel=0.2)
    assert found.hover.value == pytest.approx(450.0, rel=0.02)
    slow, fast = found.fitted_m_s
    assert slow < 7.0
    assert fast > 12.0
    assert any("through the air" in n for n in found.notes) is True


def test_a_fit_at_one_speed_predicts_that_speed_alone_and_says_so() -> None:
    legs: tuple[Leg, ...] = ((0, 0, 60, 30), (2800, 0, 0, 200), (0, 0, -40, 25), (0, 0, 40, 20), (0, 0, 0, 40))
    found = fit_energy([timed(legs, 22)])
    assert found.base.value is None
    assert found.fitted_m_s == pytest.approx((14.0, 14.0), rel=0.02)
    assert yaml.safe_load(found.yaml())["energy"]["fitted_speed_m_s"] == pytest.approx(14.0, rel=0.02)
    both = fit_energy([timed(legs, 22), timed(TWO_SPEEDS, 23)])
    slow_w = (both.base.value or 0.0) + 5.0 * (both.horizontal.value or 0.0)
    assert slow_w == pytest.approx(BASE + 5.0 * PER_M, rel=0.05)


def test_a_power_that_does_not_grow_with_speed_is_a_base_power_alone() -> None:
    t, place, _ = flown(TWO_SPEEDS, seed=24)
    watts = 320.0 * (1.0 + 0.03 * np.random.default_rng(24).standard_normal(len(t)))
    found = fit_energy([log_of(t, place, watts)])
    assert found.told
    assert found.base.value == pytest.approx(320.0, rel=0.05)
    assert found.horizontal.value == pytest.approx(0.0, abs=2.0)


@pytest.mark.parametrize(
    ("volt", "ampere", "what"), [(100.0, 100.0, "voltage"), (1000.0, 1.0, "voltage"), (1.0, 1000.0, "current")]
)
def test_readings_in_another_unit_are_refused(tmp_path: Path, volt: float, ampere: float, what: str) -> None:
    t, place, watts = flown(seed=25)
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,volt,amp", [t, *place.T, np.full(len(t), 22.2 * volt),
                  watts / 22.2 * ampere])  # fmt: skip
    with pytest.raises(InputError, match=f"tells a {what} of .*another unit"):
        read_log(file)
    milli = csv_of(tmp_path / "b.csv", "time_s,x,y,z,power", [t, *place.T, 1000.0 * watts])
    with pytest.raises(InputError, match="tells a power of"):
        read_log(milli)


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
        found = fit_energy([read_log(dataflash(tmp_path / "old.bin", rows))])
    finally:
        FORMATS.pop("CURR")
    assert within(found), found.yaml()
