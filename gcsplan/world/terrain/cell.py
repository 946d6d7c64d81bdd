"""A square of one degree, named by its south-west corner as in N36W085: the unit in which terrain is published."""

from __future__ import annotations

import re
from typing import NamedTuple

_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})")


class Cell(NamedTuple):
    """A tile of one degree by its south-west corner, whole degrees."""

    lat_deg: int
    lon_deg: int

    @property
    def north_south(self) -> str:
        """Such as ``N36``."""
        return f"{'S' if self.lat_deg < 0 else 'N'}{abs(self.lat_deg):02d}"

    @property
    def east_west(self) -> str:
        """Such as ``W085``."""
        return f"{'W' if self.lon_deg < 0 else 'E'}{abs(self.lon_deg):03d}"

    @property
    def name(self) -> str:
        """Such as ``N36W085``."""
        return self.north_south + self.east_west


def cell_of(name: str) -> Cell | None:
    """The tile of a name such as ``N36W085``; None if there is none of that name."""
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    lat = int(match[2]) * (-1 if match[1] == "S" else 1)
    lon = int(match[4]) * (-1 if match[3] == "W" else 1)
    cell = Cell(lat, lon)
    return cell if -90 <= lat < 90 and -180 <= lon < 180 and cell.name == name else None
