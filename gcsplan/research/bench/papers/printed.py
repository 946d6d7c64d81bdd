"""The five papers' result tables as printed, and which of their numbers no aircraft can have flown.

Numbers keep their printed form: one is impossible only if it is below the least value after rounding. The least value
follows from the ends of the flight alone (`StraightFlight`), by arithmetic, never from a result of gcsplan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

EastNorthUp = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class PrintedNumber:
    """A number as printed."""

    text: str

    @property
    def value(self) -> float:
        """Its value."""
        return float(self.text)

    @property
    def half_unit(self) -> float:
        """Half a unit of its last printed digit."""
        return 0.5 * 10.0 ** -len(self.text.partition(".")[2])

    def below(self, least: float) -> bool:
        """Whether every value that rounds to this number is below ``least``."""
        return self.value + self.half_unit < least

    def above(self, most: float) -> bool:
        """Whether every value that rounds to this number is above ``most``."""
        return self.value - self.half_unit > most


@dataclass(frozen=True, slots=True)
class StraightFlight:
    """The metres of a straight flight from end to end: in space, in the plane, and up or down."""

    length_m: float
    flat_m: float
    rise_m: float

    @classmethod
    def between(cls, start: Sequence[float], goal: Sequence[float]) -> StraightFlight:
        """The straight flight from ``start`` to ``goal``, each (east, north, up) in metres."""
        return cls(
            math.dist(start, goal), math.dist(start[:2], goal[:2]), abs(goal[2] - start[2])
        )  # no path is shorter in any of the three

    @classmethod
    def sum_of(cls, parts: Sequence[StraightFlight]) -> StraightFlight:
        """The sum over a fleet."""
        return cls(sum(p.length_m for p in parts), sum(p.flat_m for p in parts), sum(p.rise_m for p in parts))

    def energy_j(self, vertical_j_per_m: float, horizontal_j_per_m: float) -> float:
        """The least energy of any path, J: ``R1·Σ|Δz| + R2·Σ horizontal`` (krill paper, Table 1)."""
        return vertical_j_per_m * self.rise_m + horizontal_j_per_m * self.flat_m

    def most_pitch_deg(self, length_m: float) -> float:
        """The largest mean pitch of evenly spaced nodes on a path of ``length_m``, degrees.

        The mean of their cosines is at least flat_m / length_m, and the cosine is concave.
        """
        return math.degrees(math.acos(min(1.0, self.flat_m / length_m)))


PrintedRow = Mapping[str, PrintedNumber]
"""Printed numbers of one algorithm in one scenario, by measure. ``length_1_m`` … belong to single vehicles."""

_MOUND, _FOREST = ((0.0, 0.0, 0.0), (100.0, 100.0, 60.0)), ((0.0, 0.0, 0.0), (120.0, 120.0, 80.0))
_FIELD = ((0.0, 0.0, 0.0), (800.0, 800.0, 15.0))
_PEAK = (250.0, 250.0, 550.0)
_FOUR = tuple(
    (start, _PEAK)
    for start in ((75.0, 135.0, 400.0), (60.0, 450.0, 350.0), (450.0, 145.0, 250.0), (400.0, 400.0, 350.0))
)

PRINTED_ENDS: Mapping[str, tuple[tuple[EastNorthUp, EastNorthUp], ...]] = {
    "krill-mound": (_MOUND,),
    "krill-forest": (_FOREST,),
    "krill-hills": (_MOUND,),
    **{f"ssgwo-table{n}{twin}": (_FIELD,) for n in (3, 5, 7) for twin in ("", "-tall")},
    "abo": (((1.0, 1.0, 1.0), (85.0, 80.0, 40.0)),),
    "ib-abc-together": _FOUR,
    "ib-abc-sequence": _FOUR,
}
"""Start and goal of each vehicle as the papers print them; MSFOA shows only pictures."""

_KRILL_MEASURES = "length_m time_s energy_j"
_SSGWO_MEASURES = "best_length_m mean_length_m collisions pitch_deg yaw_deg nearest_m"
_MSFOA_MEASURES_2 = "best_cost_1 best_cost_2 best_cost_3 best_cost_sum"
_MSFOA_MEASURES_3 = "best_cost mean_cost median_cost"
_IB_ABC_MEASURES = " ".join(f"length_{i}_m time_{i}_s speed_{i}_m_s" for i in (1, 2, 3, 4))

# Krill: Tables 2-4. SSGWO: Tables 4, 6, 8; collisions count among 50 runs. MSFOA: Tables 2, 3. IB-ABC: Tables II, IV.
_PRINTED_TABLES: tuple[tuple[str, str, str], ...] = (
    ("krill-mound", _KRILL_MEASURES,
     "aco 161.6551 97.29 1784.02 | abc 153.5562 82.51 1653.80 | krill 150.6818 24.17 1475.18"),
    ("krill-forest", _KRILL_MEASURES,
     "aco 194.4623 119.19 2784.70 | abc 192.2746 47.67 2753.36 | krill 190.3142 35.75 2725.30"),
    ("krill-hills", _KRILL_MEASURES,
     "aco 216.0701 148.99 3094.12 | abc 194.8418 59.52 2790.13 | krill 178.2282 44.67 2265.82"),
    ("ssgwo-table3", _SSGWO_MEASURES,
     "gwo 1376 1462 5 41 57 102 | mgwo 1268 1379 3 35 51 81 | igwo 1337 1394 2 37 53 95 | sogwo 1233 1297 2 34 48 65 | "
     "ssgwo 1132 1203 0 29 41 57"),
    ("ssgwo-table5", _SSGWO_MEASURES,
     "gwo 1278 1351 8 44 59 93 | mgwo 1281 1362 5 37 56 87 | igwo 1226 1376 4 39 55 76 | sogwo 1321 1347 3 33 51 94 | "
     "ssgwo 1167 1203 0 26 40 68"),
    ("ssgwo-table7", _SSGWO_MEASURES,
     "gwo 1263 1358 18 53 64 92 | mgwo 1256 1289 14 45 54 84 | igwo 1292 1384 9 57 49 97 | "
     "sogwo 1225 1276 12 39 49 61 | ssgwo 1129 1178 1 26 39 51"),
    ("msfoa-1", _MSFOA_MEASURES_2,
     "msfoa 133.21 138.09 145.66 404.37 | foa 165.22 168.24 173.69 507.15 | pso 146.27 137.72 201.16 485.14 | "
     "de 158.20 184.94 218.39 561.53 | abc 113.07 142.89 155.21 411.16 | iffo 181.34 146.80 169.14 497.29 | "
     "mfoa 116.54 155.41 145.11 417.07"),
    ("msfoa-2", _MSFOA_MEASURES_2,
     "msfoa 128.79 125.52 149.90 382.95 | foa 155.16 293.51 661.07 520.27 | pso 123.72 112.26 171.77 520.27 | "
     "de 232.28 235.97 187.56 655.81 | abc 139.17 112.85 148.99 401.02 | iffo 134.56 154.59 258.29 547.44 | "
     "mfoa 126.34 109.93 152.06 388.33"),
    ("msfoa-3", _MSFOA_MEASURES_2,
     "msfoa 152.48 145.19 156.85 440.71 | foa 307.26 244.29 178.91 730.46 | pso 228.07 238.56 162.09 628.71 | "
     "de 207.78 244.22 212.59 664.59 | abc 165.08 125.62 166.76 457.45 | iffo 229.20 165.71 194.94 589.85 | "
     "mfoa 167.12 146.68 152.06 465.87"),
    ("msfoa-1", _MSFOA_MEASURES_3,
     "msfoa 404.37 490.23 466.56 | foa 507.15 708.73 698.53 | pso 485.14 797.76 754.04 | de 561.53 674.52 665.62 | "
     "abc 411.16 503.64 497.22 | iffo 497.29 859.11 860.97 | mfoa 417.07 495.04 493.33"),
    ("msfoa-2", _MSFOA_MEASURES_3,
     "msfoa 382.95 485.46 505.18 | foa 520.27 755.35 693.81 | pso 520.27 755.35 693.81 | de 655.81 761.37 768.37 | "
     "abc 401.02 516.94 520.93 | iffo 547.44 928.37 908.26 | mfoa 388.33 482.81 475.26"),
    ("msfoa-3", _MSFOA_MEASURES_3,
     "msfoa 440.71 504.20 492.95 | foa 730.46 1001.69 993.81 | pso 628.71 953.93 954.92 | de 664.59 809.74 815.48 | "
     "abc 457.45 589.69 591.39 | iffo 589.85 953.56 934.38 | mfoa 465.87 566.83 564.83"),
    ("ib-abc-together", _IB_ABC_MEASURES,
     "abc 272.164 15.952 17.0613 349.579 15.952 21.9142 423.873 15.952 26.5716 327.434 15.952 20.5260 | "
     "b-abc 262.641 14.925 17.5971 349.121 14.925 23.3913 429.754 14.925 28.7938 307.144 14.925 20.5788 | "
     "ib-abc 261.670 14.249 18.3642 349.734 14.925 24.5445 327.469 14.925 22.9818 301.035 14.925 21.1268"),
    ("ib-abc-sequence", _IB_ABC_MEASURES,
     "abc 262.65 8.7551 30 327.76 17.7496 18.4659 452.35 26.7496 16.9106 437.01 35.7496 12.2242 | "
     "b-abc 262.488 8.7496 30 328.321 17.704 18.545 432.470 26.704 16.195 424.269 35.755 11.866 | "
     "ib-abc 261.115 8.7039 30 306.704 17.755 17.2739 350.520 26.755 13.1011 421.547 35.704 11.8068"),
)  # fmt: skip


def _read() -> dict[tuple[str, str], dict[str, PrintedNumber]]:
    out: dict[tuple[str, str], dict[str, PrintedNumber]] = {}
    for scenario, measures, rows in _PRINTED_TABLES:
        names = measures.split()
        for row in rows.split("|"):
            algorithm, *numbers = row.split()
            read = dict(zip(names, map(PrintedNumber, numbers), strict=True))
            for twin in (scenario, f"{scenario}-tall") if scenario.startswith("ssgwo") else (scenario,):
                out.setdefault((twin, algorithm), {}).update(read)
    return out


PRINTED: Mapping[tuple[str, str], PrintedRow] = _read()


def least_of(scenario: str) -> tuple[StraightFlight, ...]:
    """The straight flight of each vehicle between the ends that the paper prints; empty if it prints none."""
    return tuple(StraightFlight.between(*ends) for ends in PRINTED_ENDS.get(scenario, ()))


def faults(
    row: PrintedRow, least: Sequence[StraightFlight], vertical_j_per_m: float, horizontal_j_per_m: float
) -> dict[str, str]:
    """The reasons why printed numbers are impossible, by measure; possible ones are left out."""
    out: dict[str, str] = {}
    if not least:
        return out
    every = StraightFlight.sum_of(least)
    parts = {f"length_{i}_m": part.length_m for i, part in enumerate(least, 1)}
    for measure, number in row.items():
        if measure in ("length_m", "best_length_m", "mean_length_m") and number.below(every.length_m):
            out[measure] = f"the straight line is {every.length_m:.2f} m"
        elif measure in parts and number.below(parts[measure]):
            out[measure] = f"the straight line is {parts[measure]:.2f} m"
        elif measure == "energy_j":
            joules = every.energy_j(vertical_j_per_m, horizontal_j_per_m)
            if number.below(joules):
                out[measure] = f"the straight line takes {joules:,.0f} J"
        elif measure == "pitch_deg" and "mean_length_m" in row:
            length = row["mean_length_m"]
            most = every.most_pitch_deg(max(length.value + length.half_unit, every.length_m))
            if number.above(most):
                out[measure] = f"evenly spaced nodes of a path of {length.text} m have {most:.1f}° at most"
    return out
