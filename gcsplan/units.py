"""The units that people read: three systems, one table of factors, and texts that can be shown in each system.

Inside, and in every file for machines, all is in SI. What people read is converted here and nowhere else: `Units` says
which unit a system has for each kind of number, and a `UnitText` text knows the quantities that it names. Durations are
h:mm:ss in every system, energies kJ beside Wh. Rounding is that of `gcsplan.figures`, after the conversion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, Self

from gcsplan.errors import UsageError
from gcsplan.figures import floored, raised


class Unit(NamedTuple):
    """A unit: its symbol, its size in SI, and how many decimals more than SI's own unit it is shown with."""

    symbol: str
    size: float
    finer: int = 0

    def of(self, value: float) -> float:
        """A value in SI, in this unit."""
        return value / self.size

    def decimals(self, of_si: int) -> int:
        """The decimals of a number that is shown with ``of_si`` in SI's own unit."""
        return max(0, of_si + self.finer)

    def stated(self, value: float, rounded: Callable[[float, int], float] = round) -> str:
        """A value that was given, with the digits it has: ``60`` m, ``196.85`` ft."""
        return f"{value:g}" if self.size == 1.0 else f"{rounded(self.of(value), 2):.10g}"


METRE = Unit("m", 1.0)
KILOMETRE = Unit("km", 1000.0)
FOOT = Unit("ft", 0.3048)
MILE = Unit("mi", 1609.344)
NAUTICAL_MILE = Unit("NM", 1852.0)
METRE_PER_SECOND = Unit("m/s", 1.0)
KM_PER_HOUR = Unit("km/h", 1.0 / 3.6)
MILE_PER_HOUR = Unit("mph", 0.44704)
KNOT = Unit("kt", 1852.0 / 3600.0)
FOOT_PER_MINUTE = Unit("ft/min", 0.3048 / 60.0, -2)
MINUTE = Unit("min", 60.0)
SECOND = Unit("s", 1.0)
KILOJOULE = Unit("kJ", 1000.0)
WATT_HOUR = Unit("Wh", 3600.0)
MILLIAMPERE_HOUR = Unit("mAh", 3.6)
"""The unit of charge, as energy at 1 V; see `charge`."""


def charge(volts: float) -> Unit:
    """The milliampere-hour of a battery with this nominal voltage."""
    return Unit(MILLIAMPERE_HOUR.symbol, MILLIAMPERE_HOUR.size * volts)


Kind = Literal["path", "leg", "far", "distance", "height", "amsl", "speed", "climb_rate"]


@dataclass(frozen=True, slots=True)
class Units:
    """One system: the unit of each kind of number.

    ``path`` is the length of a whole path in a table, ``leg`` that of a part of it; ``far`` is for places along a long
    track, ``distance`` for what is near: zones, other vehicles, radii. ``height`` counts from the ground or from home.
    """

    name: str
    path: Unit
    leg: Unit
    far: Unit
    distance: Unit
    height: Unit
    speed: Unit
    climb_rate: Unit

    @property
    def amsl(self) -> Unit:
        """The unit of heights, named as an altitude above mean sea level."""
        return self.height._replace(symbol=f"{self.height.symbol} AMSL")

    def along(self, length_m: float) -> Unit:
        """The unit of places along a track of this length."""
        return self.far if length_m > 2000.0 else self.distance

    def as_dict(self) -> dict[str, list[object]]:
        """Each kind's symbol, size and decimals more than in SI, for the script of a page."""
        kinds: tuple[Kind, ...] = ("path", "leg", "far", "distance", "height", "amsl", "speed", "climb_rate")
        return {kind: list(getattr(self, kind)) for kind in kinds}


METRIC = Units("metric", METRE, METRE, KILOMETRE, METRE, METRE, METRE_PER_SECOND, METRE_PER_SECOND)
IMPERIAL = Units("imperial", MILE._replace(finer=3), FOOT, MILE, FOOT, FOOT, MILE_PER_HOUR, FOOT_PER_MINUTE)
"""Speeds are in miles per hour, as in the rules and forecasts where feet are used (14 CFR 107.51: 100 mph)."""
AVIATION = Units(
    "aviation", NAUTICAL_MILE._replace(finer=3), NAUTICAL_MILE._replace(finer=3), NAUTICAL_MILE, FOOT, FOOT, KNOT,
    FOOT_PER_MINUTE,
)  # fmt: skip
SYSTEMS = {system.name: system for system in (METRIC, IMPERIAL, AVIATION)}


def units_of(name: str | Units) -> Units:
    """The system of a name. Raises UsageError for another name."""
    if isinstance(name, Units):
        return name
    if not isinstance(name, str) or name not in SYSTEMS:
        given = repr(name[:64]) if isinstance(name, str) else type(name).__name__
        raise UsageError(f"units must be {', '.join(SYSTEMS)}, given {given}")
    return SYSTEMS[name]


def duration(seconds: float | None, decimals: int = 0) -> str:
    """A duration as ``h:mm:ss`` with ``decimals`` of a second; a dash if there is none."""
    if seconds is None or not math.isfinite(seconds):
        return "–"
    parts = round(abs(seconds) * 10**decimals)
    whole, rest = divmod(parts, 10**decimals)
    text = f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}" + (f".{rest:0{decimals}d}" if decimals else "")
    return f"-{text}" if seconds < 0.0 and parts else text


def span(window_s: tuple[float, float] | None, decimals: int = 0) -> str:
    """A window of times, each as `duration` has it, rounded outward; a dash if there is none."""
    if window_s is None:
        return "–"
    earliest_s, latest_s = window_s
    return f"{duration(floored(earliest_s, decimals), decimals)} to {duration(raised(latest_s, decimals), decimals)}"


# -- texts that name quantities ---------------------------------------------------------------------------------------

Rounding = Literal["near", "down", "up"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a text, in SI, with its kind; see `quantity`."""

    value: float
    kind: Kind
    decimals: int | None
    rounding: Rounding = "near"
    trimmed: bool = False
    bare: bool = False

    def text(self, units: Units | None) -> str:
        """The number in a system, with its unit unless it is bare."""
        unit: Unit = getattr(units or METRIC, self.kind)
        gap = "" if self.bare else f" {unit.symbol}"
        if self.decimals is None:
            return unit.stated(self.value) + gap
        decimals, value = unit.decimals(self.decimals), unit.of(self.value)
        value = {"near": _same, "down": floored, "up": raised}[self.rounding](value, decimals)
        return (f"{value:.10g}" if self.trimmed else f"{value:.{decimals}f}") + gap


def _same(value: float, decimals: int) -> float:
    return value


@dataclass(frozen=True, slots=True)
class Symbol:
    """The symbol of a kind's unit alone, before numbers that are bare."""

    kind: Kind

    def text(self, units: Units | None) -> str:
        """The symbol in a system."""
        return str(getattr(units or METRIC, self.kind).symbol)


@dataclass(frozen=True, slots=True)
class Reach:
    """A length in its large unit (``9.5 km``), or in its small one if it is short (``340 m``)."""

    metres: float

    def text(self, units: Units | None) -> str:
        """The length in a system."""
        system = units or METRIC
        unit, decimals = (system.far, 1) if self.metres >= 999.5 else (system.distance, 0)
        return f"{unit.of(self.metres):.{decimals}f} {unit.symbol}"


@dataclass(frozen=True, slots=True)
class Seconds:
    """A time: seconds in files, ``h:mm:ss`` for people."""

    value: float
    decimals: int = 0

    def text(self, units: Units | None) -> str:
        """The time."""
        return f"{self.value:.{self.decimals}f} s" if units is None else duration(self.value, self.decimals)


@dataclass(frozen=True, slots=True)
class Joules:
    """An energy: joules in files, kilojoules and watt-hours for people."""

    value: float

    def text(self, units: Units | None) -> str:
        """The energy."""
        if units is None:
            return f"{self.value:.0f} J"
        return f"{KILOJOULE.of(self.value):.0f} kJ ({WATT_HOUR.of(self.value):.0f} Wh)"


class UnitText(str):
    """A text that knows its quantities: as a str it is in SI, as files have it; `in_units` shows it in a system.

    ``template`` is one of `str.format` with a field for each of ``parts``: a quantity, another text, or anything that
    is the same in all systems.
    """

    __slots__ = ("parts", "template")

    def __new__(cls, template: str, *parts: object) -> Self:
        text = super().__new__(cls, _filled(template, parts, None))
        text.template, text.parts = template, parts
        return text

    template: str
    parts: tuple[object, ...]

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (self.template, *self.parts)


Part = Quantity | Symbol | Reach | Seconds | Joules


class Readable(Protocol):
    """A datum that makes its own sentence, such as a note."""

    def in_units(self, units: Units) -> str:
        """The sentence with its quantities in ``units``."""


def in_units(text: str | Readable, units: Units) -> str:
    """A text for people: its quantities in ``units``. A plain text is itself."""
    if not isinstance(text, str):
        return text.in_units(units)
    return _filled(text.template, text.parts, units) if isinstance(text, UnitText) else text


def _filled(template: str, parts: Sequence[object], units: Units | None) -> str:
    texts: list[object] = []
    for part in parts:
        if isinstance(part, Part):
            texts.append(part.text(units))
        elif isinstance(part, UnitText) or hasattr(part, "in_units"):
            texts.append(str(part) if units is None else in_units(part, units))
        else:
            texts.append(part)
    return template.format(*texts)
