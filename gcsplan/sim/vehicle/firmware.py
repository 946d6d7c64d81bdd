"""Firmware versions of the simulated vehicles, and one table of what differs between them.

A change in `FIRMWARE_CHANGES` is what a ground station sees: each names its family, the first version that has it, and
the behaviour before and since. A vehicle asks ``firmware.has(CHANGE)``; the table in the reference is made from these
rows.

Sources: ArduPilot 4.6.2 and 4.7 (September 2025), ``MissionItemProtocol*.cpp``, ``AP_Mission.cpp``,
``AC_PolyFence_loader.cpp``; PX4 1.16, 1.17 and main (August 2026), ``mavlink_mission.cpp``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gcsplan.errors import UsageError
from gcsplan.vehicle import Autopilot

ARDUPILOT_FAMILY, PX4_FAMILY = "ArduPilot", "PX4"


@dataclass(frozen=True, slots=True)
class FirmwareChange:
    """One difference that a ground station sees: ``since`` is the first version (major, minor) that has it."""

    family: str
    since: tuple[int, int]
    what: str
    before: str
    after: str


COUNTS_EVERY_LIST = FirmwareChange(
    ARDUPILOT_FAMILY, (4, 7), "request past the end of a list",
    "mission: MISSION_COUNT and ACK 1; fence and rally points: ACK 13, but ACK 1 right after the last fence item",
    "every list: MISSION_COUNT and ACK 13; to the old MISSION_REQUEST ACK 13 alone",
)  # fmt: skip
KEEPS_HOME = FirmwareChange(
    ARDUPILOT_FAMILY, (4, 7), "home in an empty mission",
    "an empty mission has no items",
    "home is item 0 as soon as it is known, on a plane again 5 s after the mission was cleared; a single item sent to "
    "an empty mission is stored behind it, as item 1",
)  # fmt: skip
KEEPS_RADII = FirmwareChange(
    ARDUPILOT_FAMILY, (4, 7), "radius of a fence circle",
    "less than 1 mm above whole metres it reads back as whole metres",
    "it reads back as sent",
)  # fmt: skip
NAMES_UNITS = FirmwareChange(
    ARDUPILOT_FAMILY, (4, 7), "names of parameters",
    "ANGLE_MAX, ARMING_CHECK, LAND_ALT_LOW, LAND_SPEED, LAND_SPEED_HIGH, RTL_ALT, RTL_ALT_FINAL, RTL_CLIMB_MIN, "
    "RTL_SPEED, SYSID_MYGCS, SYSID_THISMAV, WPNAV_ACCEL, WPNAV_ACCEL_C, WPNAV_ACCEL_Z, WPNAV_JERK, WPNAV_RADIUS, "
    "WPNAV_SPEED, WPNAV_SPEED_DN, WPNAV_SPEED_UP, WPNAV_TER_MARGIN: centimetres and hundredths of a degree",
    "ATC_ANGLE_MAX, ARMING_SKIPCHK, LAND_ALT_LOW_M, LAND_SPD_MS, LAND_SPD_HIGH_MS, RTL_ALT_M, RTL_ALT_FINAL_M, "
    "RTL_CLIMB_MIN_M, RTL_SPEED_MS, MAV_GCS_SYSID, MAV_SYSID, WP_ACC, WP_ACC_CNR, WP_ACC_Z, WP_JERK, WP_RADIUS_M, "
    "WP_SPD, WP_SPD_DN, WP_SPD_UP, WP_TER_MARGIN: metres and degrees",
)  # fmt: skip
TAKES_ARCS = FirmwareChange(
    ARDUPILOT_FAMILY, (4, 7), "NAV_ARC_WAYPOINT in a copter's mission", "refused: ACK 3", "stored as sent, and flown",
)  # fmt: skip
TAKES_ARM_ITEMS = FirmwareChange(
    PX4_FAMILY, (1, 17), "COMPONENT_ARM_DISARM in a mission", "refused: ACK 3", "stored",
)  # fmt: skip
TELLS_MISSION_STATE = FirmwareChange(
    PX4_FAMILY, (1, 17), "mission_state and mission_mode of MISSION_CURRENT", "always 0", "the state and the mode",
)  # fmt: skip
TAKES_AUTOTUNE_ITEMS = FirmwareChange(
    PX4_FAMILY, (1, 18), "DO_AUTOTUNE_ENABLE in a mission", "refused: ACK 3", "stored",
)  # fmt: skip

FIRMWARE_CHANGES = (
    COUNTS_EVERY_LIST, KEEPS_HOME, KEEPS_RADII, NAMES_UNITS, TAKES_ARCS,
    TAKES_ARM_ITEMS, TELLS_MISSION_STATE, TAKES_AUTOTUNE_ITEMS,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Firmware:
    """One version of one family; ``version``: major, minor."""

    family: str
    version: tuple[int, int]

    @property
    def name(self) -> str:
        """``4.7``."""
        return ".".join(map(str, self.version))

    @property
    def flight_sw_version(self) -> int:
        """The number in AUTOPILOT_VERSION: major, minor, patch 0, and 255 for an official release."""
        return self.version[0] << 24 | self.version[1] << 16 | 255

    def has(self, change: FirmwareChange) -> bool:
        """Whether a change of this firmware's family is in it."""
        return change.family == self.family and change.since <= self.version


KNOWN_FIRMWARE: dict[str, tuple[Firmware, ...]] = {
    ARDUPILOT_FAMILY: (Firmware(ARDUPILOT_FAMILY, (4, 6)), Firmware(ARDUPILOT_FAMILY, (4, 7))),
    PX4_FAMILY: (Firmware(PX4_FAMILY, (1, 17)), Firmware(PX4_FAMILY, (1, 16)), Firmware(PX4_FAMILY, (1, 18))),
}
"""The versions that can be simulated, by family; the first is the default."""


def firmware_of(autopilot: Autopilot, name: str | None = None) -> Firmware:
    """Return a version of an autopilot's firmware by its name, None: the default. Raises UsageError."""
    return firmwares([autopilot], name)[0]


def firmwares(autopilots: Sequence[Autopilot], name: str | None) -> list[Firmware]:
    """Return each vehicle's firmware: the version ``name`` if its autopilot has that, else the default.

    Raises UsageError for a version that none of the autopilots has.
    """
    known = [KNOWN_FIRMWARE[ARDUPILOT_FAMILY if autopilot.is_ardupilot else PX4_FAMILY] for autopilot in autopilots]
    names = {f.name for versions in known for f in versions}
    if name is not None and name not in names:
        raise UsageError(f"--firmware {name}: give one of {', '.join(sorted(names))}")
    return [next((f for f in versions if f.name == name), versions[0]) for versions in known]
