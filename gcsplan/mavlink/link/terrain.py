"""Terrain over a link: answer TERRAIN_REQUEST with TERRAIN_DATA, and compare what the vehicle reads with what it got.

The vehicle asks for a block by its corner, and in it for the parts, of 56, that it lacks, again every 2 s until it has
them (AP_Terrain, `send_request`). A part of which one post is unknown is never sent: unknown is not ground. The queue
of parts is bounded, and sent at a pace that leaves room for the rest of the link.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.arrays import Floats
from gcsplan.errors import GcsplanError, VehicleRefused
from gcsplan.mavlink.link.link import Channel, Heard, LinkSteps
from gcsplan.mavlink.mission.mission import TERRAIN, MissionItem
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.notes.note import Note
from gcsplan.world.terrain.grid import (
    ALL_PARTS,
    NEAR_ENOUGH_M,
    SPACING_M,
    Block,
    GroundHeights,
    PostHeights,
    TerrainGrid,
    known_parts,
    part_of,
)

LEAST_SPACING_M, MOST_SPACING_M = 5, 1000
MOST_SPACINGS = 4
MOST_WAITING = 64
"""Blocks that wait to be sent; the vehicle asks again for dropped ones. Its cache holds 12."""

_PAUSE_S = 0.01
_PARTS_AT_ONCE = 4
_SERIAL_SHARE = 0.25
_BYTES_OF_PART = 43 + 12 + 13  # payload, frame, signature
ASK_AFTER_S, _ASK_EVERY_S, _MOST_REQUESTS = 3.0, 5.0, 3
_REQUESTS_EVERY_US = 500_000.0


@dataclass
class Served:
    """The requests and answers so far. ``unknown``: blocks with parts that cannot be sent; ``strange``: requests
    for blocks that are none of ArduPilot's."""

    requests: int = 0
    parts: int = 0
    blocks: set[Block] = field(default_factory=set)
    unknown: dict[Block, int] = field(default_factory=dict)
    strange: int = 0
    problems: list[str] = field(default_factory=list)

    @property
    def notes(self) -> list[Note]:
        """Notes for the user."""
        out = [Note("terrain_not_loaded", why=why) for why in self.problems]
        if self.unknown:
            parts = sum(self.unknown.values())
            first = min(self.unknown)
            out.append(Note("terrain_parts_not_sent", parts=parts, blocks=len(self.unknown), tile=first.cell.name))
        if self.strange:
            out.append(Note("terrain_requests_strange", count=self.strange))
        return out


class TerrainService:
    """The terrain that vehicles are given: heights by the spacing that they ask for, and what was given."""

    def __init__(self, ground: GroundHeights) -> None:
        self._ground = ground
        self._posts: dict[int, PostHeights] = {}
        self.served: dict[int, Served] = {}

    def posts(self, spacing_m: int) -> PostHeights:
        """The heights of the grid with that spacing."""
        if spacing_m not in self._posts:
            while len(self._posts) >= MOST_SPACINGS:
                del self._posts[next(iter(self._posts))]
            self._posts[spacing_m] = PostHeights(TerrainGrid(spacing_m), self._ground)
        return self._posts[spacing_m]

    def steps(self, channel: Channel) -> LinkSteps[None]:
        """The endless task that answers one vehicle. See `Link.serve`."""
        return _Answers(channel, self, self.served.setdefault(channel.sysid, Served())).steps()


@dataclass
class _Waiting:
    """Parts of a block that are to be sent."""

    to: Heard
    block: Block
    heights: Floats
    bits: list[int]


class _Answers:
    def __init__(self, channel: Channel, service: TerrainService, served: Served) -> None:
        self._channel, self._service, self._served = channel, service, served
        self._queue: OrderedDict[tuple[int, int, int], _Waiting] = OrderedDict()
        endpoint = channel.link.endpoint
        baud = endpoint.baud if endpoint.kind == "serial" else 0
        self._at_once = 1 if baud else _PARTS_AT_ONCE
        self._pause_s = 10.0 * _BYTES_OF_PART / (_SERIAL_SHARE * baud) if baud else _PAUSE_S

    def steps(self) -> LinkSteps[None]:
        clock = self._channel.link.clock
        ask_at, requests, send_at = clock() + ASK_AFTER_S, 0, -math.inf
        vehicle: Heard | None = None
        while True:
            for heard in self._channel.take():
                kind = "" if heard.late else heard.message.get_type()
                if kind == "HEARTBEAT" and heard.message.autopilot == dialect.MAV_AUTOPILOT_ARDUPILOTMEGA:
                    vehicle = heard
                elif kind == "TERRAIN_REQUEST":
                    requests = _MOST_REQUESTS  # it sends them by itself
                    self._note(heard)
            now = clock()
            if now >= ask_at and requests < _MOST_REQUESTS and vehicle is not None:
                _ask_for_requests(self._channel, vehicle)
                requests, ask_at = requests + 1, now + _ASK_EVERY_S
            if self._queue and now >= send_at:
                self._send()
                send_at = now + self._pause_s
            yield send_at if self._queue else max(ask_at, now + 0.1) if requests < _MOST_REQUESTS else math.inf

    def _note(self, heard: Heard) -> None:
        m, served = heard.message, self._served
        served.requests += 1
        spacing = int(m.grid_spacing)
        block = None
        if LEAST_SPACING_M <= spacing <= MOST_SPACING_M:
            posts = self._service.posts(spacing)
            block = posts.grid.block_at(m.lat, m.lon)
        if block is None:
            served.strange += 1
            return
        try:
            heights = posts.block(block)
        except GcsplanError as why:  # terrain that cannot be loaded is unknown
            if why.message not in served.problems:
                served.problems.append(why.message)
            return
        known = known_parts(heights)
        requested = int(m.mask) & ALL_PARTS
        missing = requested & ~known
        if missing:
            served.unknown[block] = missing.bit_count()
        bits = [bit for bit in range(ALL_PARTS.bit_length()) if requested & known & (1 << bit)]
        if bits:
            self._queue[m.lat, m.lon, spacing] = _Waiting(heard, block, heights, bits)
        while len(self._queue) > MOST_WAITING:
            self._queue.popitem(last=False)

    def _send(self) -> None:
        for _ in range(self._at_once):
            if not self._queue:
                return
            (lat, lon, spacing), first = next(iter(self._queue.items()))
            bit = first.bits.pop(0)
            data = [int(h) for h in part_of(first.heights, bit)]
            message = dialect.MAVLink_terrain_data_message(lat, lon, spacing, bit, data)
            self._channel.link.send(message, first.to.source, first.to.peer)
            self._served.parts += 1
            self._served.blocks.add(first.block)
            if not first.bits:
                del self._queue[lat, lon, spacing]


def _ask_for_requests(channel: Channel, vehicle: Heard) -> None:
    """Ask for TERRAIN_REQUEST and TERRAIN_REPORT, which a link without streams does not carry."""
    interval = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
    for kind in (dialect.MAVLINK_MSG_ID_TERRAIN_REQUEST, dialect.MAVLINK_MSG_ID_TERRAIN_REPORT):
        message = dialect.MAVLink_command_long_message(
            *vehicle.source, interval, 0, kind, _REQUESTS_EVERY_US, 0, 0, 0, 0, 0
        )
        channel.link.send(message, vehicle.source, vehicle.peer)


@dataclass(frozen=True, slots=True)
class TerrainComparison:
    """The heights that the vehicle reads at places, beside the heights that it was sent.

    ``off_m`` (N,): its height less ours, NaN where it has none. ``pending``, ``loaded``: parts, by its last report.
    """

    places_e7: tuple[tuple[int, int], ...]
    off_m: Floats
    pending: int
    loaded: int

    @property
    def read(self) -> int:
        """At how many places it has a height."""
        return int(np.count_nonzero(~np.isnan(self.off_m)))

    @property
    def worst_m(self) -> float:
        """The largest difference, m; NaN if it has no height anywhere."""
        return float(np.nanmax(np.abs(self.off_m))) if self.read else math.nan

    @property
    def worst_at(self) -> tuple[float, float] | None:
        """Where that is, degrees."""
        if not self.read:
            return None
        lat, lon = self.places_e7[int(np.nanargmax(np.abs(self.off_m)))]
        return lat / 1e7, lon / 1e7


_OUTSTANDING = 12
_BLOCKS_AT_ONCE = 2
"""The vehicle keeps 12 blocks, nine of them around itself: to read more of them, it would drop one for the other."""
_ANSWER_S, _UNREAD_S = 0.4, 0.5


def compare_steps(
    channel: Channel,
    to: Address,
    places_e7: Sequence[tuple[int, int]],
    posts: PostHeights,
    *,
    patience_s: float,
    most_s: float = math.inf,
    progress: Callable[[int, int], None] | None = None,
    note: Callable[[Heard, float], None] | None = None,
) -> LinkSteps[TerrainComparison]:
    """Ask with TERRAIN_CHECK what the vehicle reads at each place, until it has all, or nothing new for so long.

    It asks for the places block by block, for the vehicle's cache holds few blocks; a service on the same link sends
    the blocks that it lacks. ``most_s``: the longest time for all; ``note``: is called with every message.
    """
    clock = channel.link.clock
    at = np.array(places_e7, float).reshape(-1, 2)
    ours = posts.amsl(at[:, 0], at[:, 1])
    block_of = {place: posts.grid.blocks_over(*place)[0] for place in places_e7}
    left: OrderedDict[tuple[int, int], list[int]] = OrderedDict()  # one answer serves a place that is given twice
    for k in sorted(range(len(places_e7)), key=lambda k: block_of[places_e7[k]]):
        left.setdefault(places_e7[k], []).append(k)
    theirs = np.full(len(places_e7), np.nan)
    ask_at: dict[tuple[int, int], float] = {}
    pending = loaded = 0
    began = moved_at = clock()
    while left and clock() < min(moved_at + patience_s, began + most_s):
        now = clock()
        soon = list(islice(left, _OUTSTANDING))
        blocks = list(dict.fromkeys(block_of[place] for place in soon))[:_BLOCKS_AT_ONCE]
        for place in soon:
            if block_of[place] in blocks and now >= ask_at.get(place, -math.inf):
                channel.send(dialect.MAVLink_terrain_check_message(*place), to)
                ask_at[place] = now + _ANSWER_S
        yield now + _ANSWER_S / 4
        for heard in channel.take():
            m: Any = heard.message
            if note:
                note(heard, clock())
            if heard.late or heard.source != to or m.get_type() != "TERRAIN_REPORT":
                continue
            moved_at = clock() if (m.loaded, m.pending) != (loaded, pending) else moved_at
            pending, loaded = int(m.pending), int(m.loaded)
            place = (int(m.lat), int(m.lon))
            if place not in left:
                continue
            if m.spacing == 0:
                ask_at[place] = clock() + _UNREAD_S
                continue
            if m.spacing == posts.grid.spacing_m and math.isfinite(m.terrain_height):
                theirs[left[place]] = m.terrain_height
            del left[place]
            moved_at = clock()
            if progress:
                progress(len(places_e7) - len(left), len(places_e7))
    return TerrainComparison(tuple(places_e7), theirs - ours, pending, loaded)


OFF = "terrain_off_m"
"""Beside the parameters that were read: how far the vehicle's heights are off the heights that it was sent, m."""

TERRAIN_GROUPS = (("TERRAIN_ENABLE",), ("TERRAIN_SPACING",), ("TERRAIN_OFS_MAX",))
"""More parameters, which are read before a mission in the terrain frame is sent."""

TERRAIN_DECIDES = (("TERRAIN_SPACING",), ("TERRAIN_OFS_MAX",))
"""The parameters of `TERRAIN_GROUPS` with which such a mission is judged: no answer is not their default."""

PLACES_COMPARED = 40
"""Places that are compared before a mission is sent."""
_UPLOAD_PATIENCE_S, _UPLOAD_MOST_S = 10.0, 45.0


_TERRAIN_FRAMES = (TERRAIN, 11)


def flies_terrain(items: Sequence[MissionItem]) -> bool:
    """Whether a mission has an item in the terrain frame."""
    return any(item.frame in _TERRAIN_FRAMES for item in items)


def terrain_error_m(values: Mapping[str, float], judged_m: float) -> float:
    """The error of terrain-frame legs, m, by what was read from the vehicle; ``judged_m`` if nothing was.

    ArduPilot shifts all its terrain by at most TERRAIN_OFS_MAX when it arms.
    """
    shift_m, off_m = values.get("TERRAIN_OFS_MAX", math.nan), values.get(OFF, math.nan)
    if not math.isfinite(shift_m) or shift_m < 0.0:
        return judged_m if math.isnan(off_m) else max(judged_m, off_m)
    return max(judged_m, shift_m) if math.isnan(off_m) else shift_m + off_m


def odd_spacing(values: Mapping[str, float]) -> Note | None:
    """That the spacing of the terrain posts on board is none that is judged; None if it is, or was not read."""
    spacing = values.get("TERRAIN_SPACING", float(SPACING_M))
    if LEAST_SPACING_M <= spacing <= MOST_SPACING_M:
        return None
    return Note(
        "terrain_spacing_not_judged", spacing_m=spacing, least_m=LEAST_SPACING_M, most_m=MOST_SPACING_M,
        set_m=SPACING_M,
    )  # fmt: skip


def places_along(items: Sequence[MissionItem], count: int = PLACES_COMPARED) -> list[tuple[int, int]]:
    """Places, 1e-7°, on the legs to the items in the terrain frame, evenly on each."""
    placed = [item for item in items if item.x or item.y]
    legs = [(a, b) for a, b in pairwise(placed) if b.frame in _TERRAIN_FRAMES]
    if not legs:
        return []
    chosen = legs[:: math.ceil(len(legs) / count)]
    parts = np.linspace(1.0, 0.0, max(1, count // len(chosen)), endpoint=False)
    turn = 3_600_000_000
    return [
        (round(a.x + f * (b.x - a.x)), a.y + round(f * ((b.y - a.y + turn // 2) % turn - turn // 2)))
        for a, b in chosen
        for f in parts.tolist()
    ]


def terrain_steps(
    channel: Channel,
    to: Address,
    items: Sequence[MissionItem],
    values: Mapping[str, float],
    ground: GroundHeights | None,
    note: Callable[[Heard, float], None],
) -> LinkSteps[tuple[list[Note], dict[str, float]]]:
    """Serve a vehicle the terrain of a mission and compare what it then reads under it.

    Return warnings, and `OFF` if it read anything. Nothing is done without ``ground`` or items in the terrain frame.
    """
    places = places_along(items)
    if ground is None or not places:
        return [], {}
    if values.get("TERRAIN_ENABLE") == 0.0:
        return [Note("terrain_off_on_board")], {}
    if odd := odd_spacing(values):
        raise VehicleRefused(f"not sent: {odd}", where=f"vehicle {to.sysid}", reason="parameters")
    spacing = values.get("TERRAIN_SPACING", float(SPACING_M))
    service = TerrainService(ground)
    channel.link.serve(channel.sysid, service.steps)
    compared = yield from compare_steps(
        channel, to, places, service.posts(int(spacing)), patience_s=_UPLOAD_PATIENCE_S, most_s=_UPLOAD_MOST_S,
        note=note,
    )  # fmt: skip
    warnings = list(service.served[channel.sysid].notes)
    if compared.read < len(places):
        warnings.append(Note("terrain_incomplete_on_board", lacking=len(places) - compared.read, places=len(places)))
    if not compared.read:
        return warnings, {}
    if compared.worst_m > NEAR_ENOUGH_M and compared.worst_at is not None:
        lat, lon = compared.worst_at
        warnings.append(Note("terrain_differs_on_board", off_m=compared.worst_m, lat_deg=lat, lon_deg=lon))
    return warnings, {OFF: compared.worst_m}
