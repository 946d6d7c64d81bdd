"""Shown texts back as numbers in SI: durations, numbers with thin spaces, and the quantities of a text."""

from __future__ import annotations

import re
from fractions import Fraction

from gcsplan.check.verdict import PAPER_MARK

FOOT, MILE = Fraction(3048, 10000), Fraction(5280 * 3048, 10000)
EXACT = {
    "m": Fraction(1), "km": Fraction(1000), "ft": FOOT, "mi": MILE, "NM": Fraction(1852), "m/s": Fraction(1),
    "mph": MILE / 3600, "kt": Fraction(1852, 3600), "ft/min": FOOT / 60, "kJ": Fraction(1000), "Wh": Fraction(3600),
    "mAh": Fraction(3600, 1000),
}  # fmt: skip
"""Sizes in SI by definition: the foot and mile of 1959, the nautical mile of 1929."""

SPACES = "\u2009\u202f "


def seconds(text: str) -> float:
    """Seconds of a duration as it is shown, ``0:31:46`` or ``0:31:46.4``."""
    found = re.fullmatch(r"(-?)(\d+):([0-5]\d):([0-5]\d(?:\.\d+)?)", text)
    assert found is not None, text
    sign, hours, minutes, rest = found.groups()
    return (-1.0 if sign else 1.0) * (3600.0 * int(hours) + 60.0 * int(minutes) + float(rest))


def number(text: str) -> float:
    """A number as it is shown, ``1 234.5``, with or without whose figures it counts."""
    return float(re.sub(f"[{SPACES}]", "", text.removesuffix(PAPER_MARK)))


NUMBER = r"-?\d{1,3}(?:[\u2009\u202f]\d{3})+(?:\.\d+)?|-?\d+(?:\.\d+)?"
UNIT = r"(?:km|mi|NM|mph|kt|m/s|ft/min|ft|m)(?![\w/])"
QUANTITY = re.compile(
    rf"(?<!\w)(?P<first>{UNIT}) (?P<from>{NUMBER})(?: to (?P<to>{NUMBER}))?"  # mi 0.93 to 2.14
    rf"|(?P<low>{NUMBER}) ?– ?(?P<high>{NUMBER})[\u202f ](?P<range>{UNIT})"
    rf"|(?P<value>{NUMBER})[\u202f ](?P<unit>{UNIT})(?: of (?P<limit>{NUMBER}),)?"
)


def taken_apart(text: str) -> tuple[str, list[tuple[float, float]]]:
    """The words without their quantities, and each quantity in SI with the size of its last digit."""
    found: list[tuple[float, float]] = []

    def take(match: re.Match[str]) -> str:
        symbol = match["first"] or match["range"] or match["unit"]
        size = float(EXACT[symbol])
        for name in ("from", "to", "low", "high", "value", "limit"):
            if match[name]:
                digits = len(match[name].partition(".")[2])
                found.append((size * number(match[name]), size * 10.0**-digits))
        return "#"

    return QUANTITY.sub(take, text), found


def same(found: list[tuple[float, float]], expected: list[tuple[float, float]]) -> None:
    assert len(found) == len(expected)
    for (value, digit), (si, of_si) in zip(found, expected, strict=True):
        assert abs(value - si) <= 1.01 * max(digit, of_si) + 0.51 * min(digit, of_si), (value, si)
