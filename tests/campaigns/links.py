"""Uploads among adversaries, in simulated time: ``python -m tests.campaigns.links --seconds 120``.

Each run is one fleet upload through all code from `uploads.run_jobs` down to the frames, on a bad radio, with a seeded
mixture of trouble: vehicles that lose, corrupt, refuse or forget what they receive, are armed, moved, switched off,
rebooted, edited by a second ground station or replaced by another one; twins with the same system id at another
address or at the same one; forged mission messages, hostile parameters and telemetry; signatures, and replayed
recordings. The results are compared with what the vehicles really received and hold:

- *false verified*: reported as verified, but at no time of the read-back on board;
- *misdelivered*: an announcement, an item or a clearing was sent to a vehicle that is not the checked one, or that had
  reported to be elsewhere or (announcements, clearings) armed;
- *untold*: exit 0 although the vehicle had reported, by the end of the last look after the read-back, to be armed or
  moved, or although a rival was heard;
- *hang*: longer than the timeouts allow; *crash*: exit 70, or an exception.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import math
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from gcsplan.app.upload import run as uploads
from gcsplan.errors import GcsplanError
from gcsplan.mavlink.link.frames import FrameParser, Signing, SigningKey
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.transport import Peer
from gcsplan.mavlink.mission.autopilots import altitude_of_cm
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot
from tests.campaigns.air import Air, Hang, Radio
from tests.campaigns.crafts import SILENCE_S, Craft, Forger, OddParameters, Recorder, Voice

URL = "udpout:127.0.0.1:14560"
COUNT, ITEM, CLEAR, REQUEST_LIST, ACK = 44, 73, 45, 43, 47
WRITES = (COUNT, ITEM, CLEAR)
LAST_LOOK_S = 10.0
FIND_S, STANDBY_S, PARAMETERS_S = 10.0, 30.0, 4.0
LOOKED_S = 2.0
"""Most seconds from a vehicle's last message to a write: gcsplan requires 1.5 s, and judges messages every 0.1 s."""
ALIKE_FRAMES = 4
"""After more positions than this of each of two vehicles at one address, gcsplan must know that there are two."""


def mission_of(sysid: int, autopilot: Autopilot, count: int, home: Home) -> Mission:
    """A mission of ``count`` way points that lead away from ``home``."""
    z = altitude_of_cm(6500, autopilot)
    items = tuple(
        MissionItem(16, 3, (0.0,) * 4, home.lat_e7 + 1000 * n + sysid, home.lon_e7 + 777 * n, z + n)
        for n in range(1, count + 1)
    )
    return Mission(autopilot, home, items, f"uav{sysid}", sysid)


@dataclass
class Seat:
    """One vehicle that a mission is sent to, the others with its system id, and what the ground station wrote.

    ``checked``: the craft that the ground station found first; ``pinned``, ``to``: where its first write went.
    """

    craft: Craft
    address: Peer
    mission: Mission
    others: list[Craft] = field(default_factory=list)
    began: float = 0.0
    requested_at: float = 0.0  # time of the last request of the list
    acked_at: float = 0.0
    wrote: int = 0
    checked: Craft | None = None
    pinned: Peer | None = None
    to: Address | None = None


class Run:
    """One seeded run."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.rng = rng = random.Random(seed)
        self.options = uploads.UploadOptions(
            unchecked=True, allow_armed=rng.random() < 0.1, ignore_position=rng.random() < 0.1,
            atomic=rng.random() < 0.25, timeout_s=rng.choice((5.0, 20.0, 60.0, 60.0)),
        )  # fmt: skip
        loss = rng.choice((0.0, 0.0, 0.0, 0.02, 0.1, 0.3, 0.6))
        radio = Radio(
            loss, rng.choice((0.0, 0.0, 0.05, 0.3)), rng.choice((0.0, 0.0, 0.1)), rng.choice((0.001, 0.02, 0.3)),
            rng.choice((0.0, 0.02, 0.2)), rng.choice((0.4, 1.5)),
        )  # fmt: skip
        self.air = Air(seed, radio, limit_s=4000.0)
        self.air.written, self.air.heard = self._written, self._heard
        self.key = SigningKey(bytes(range(32))) if rng.random() < 0.25 else None
        self.found: list[str] = []
        self.seats: dict[int, Seat] = {}
        self.voices: dict[tuple[Address, Peer], Voice] = {}
        self._parser = FrameParser()
        self._recorder = Recorder(self.air)
        self.happened: list[str] = []
        for sysid in range(1, rng.choice((1, 1, 1, 2, 3)) + 1):
            self._seat(sysid)

    # vehicles and trouble

    def _signing(self) -> Signing | None:
        return Signing(self.key, clock=self.air.wall_clock) if self.key else None

    def _vehicle(self, sysid: int, autopilot: Autopilot, home: Home, **more: Any) -> LoopbackVehicle:
        return LoopbackVehicle(
            sysid, autopilot, lat_deg=home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7, amsl_m=home.amsl_m, **more
        )

    def _seat(self, sysid: int) -> None:
        rng, air = self.rng, self.air
        autopilot = rng.choice(list(Autopilot))
        home = Home.at(36.6 + 0.01 * sysid, -84.38, 371.0)
        mission = mission_of(sysid, autopilot, rng.choice((1, 3, 6, 12, 12, 40)), home)
        trouble = self._trouble() if rng.random() < 0.35 else Misbehaviour(seed=rng.randrange(2**31))
        boot_s = rng.choice((0.0, 0.0, 0.0, 3.0, 15.0))
        craft = Craft(self._vehicle(sysid, autopilot, home, misbehave=trouble, boot_s=boot_s), air, self._signing())
        craft.expected = mission.wire_items()
        if rng.random() < 0.5:
            old = mission_of(sysid, autopilot, rng.choice((2, 9, 300)), Home.at(36.7, -84.3, 371.0))
            craft.vehicle.load(old.wire_items())
        if rng.random() < 0.3:
            craft.hub.vehicles[0][1].parameters = OddParameters(autopilot, sysid, rng)
        address = f"address {sysid}" if rng.random() < 0.8 else "router"
        seat = self.seats[sysid] = Seat(craft, address, mission)
        self._put(craft, address)
        for act in (self._change, self._change, self._twin, self._forge, self._swap, self._edit):
            if rng.random() < 0.25:
                act(seat)

    def _put(self, craft: Craft, address: Peer) -> None:
        craft.address, craft.there_since = address, self.air.now
        self.air.put(address, craft)

    def _trouble(self) -> Misbehaviour:
        rng = self.rng
        some: dict[str, Any] = {"seed": rng.randrange(2**31)}
        for name, value in (
            ("corrupt", rng.randrange(12)), ("silent_after", rng.choice((0, 1, 5, 20, 40))),
            ("reboot_at", rng.randrange(12)), ("edit", rng.randrange(12)), ("stray_sysid", rng.randrange(1, 9)),
            ("stale_type", rng.randrange(3)), ("answer_sysid", rng.randrange(1, 9)), ("refuse", rng.randrange(12)),
            ("no_space", True), ("armed", True), ("reboot_loses", True), ("drop", rng.random() * 0.7),
            ("duplicate", rng.random()), ("delay", rng.random()), ("reorder", rng.random() * 0.5),
        ):  # fmt: skip
            if rng.random() < 0.15:
                some[name] = value
        some["corrupt_field"] = rng.choice(("x", "y", "z", "param1", "command", "frame"))
        some["refuse_code"] = rng.randrange(1, 16)
        some["reboot_s"] = rng.choice((0.5, 4.0, 20.0))
        some["delay_s"] = rng.choice((0.1, 1.0, 6.0))
        return Misbehaviour(**some)

    def _when(self) -> float:
        """A random time (s): before the vehicle is found, during the first look, during the transfer, or later."""
        rng = self.rng
        return rng.choice(
            (rng.uniform(0.0, 2.0), rng.uniform(1.5, 4.0), rng.uniform(2.0, 12.0), rng.uniform(5.0, 60.0))
        )

    def _do(self, what: str, seat: Seat, act: Any) -> None:
        at = self._when()

        def now() -> None:
            self.happened.append(f"{self.air.now - 1000.0:.2f} s: {what} {seat.craft.vehicle.sysid}")
            act()

        self.air.later(at, now)

    def _change(self, seat: Seat) -> None:
        rng, craft, air = self.rng, seat.craft, self.air
        kind = rng.choice(("armed", "armed", "far", "near", "silent", "reboot", "back changed"))

        def armed() -> None:
            craft.arm()
            if rng.random() < 0.2:
                air.later(rng.uniform(0.5, 5.0), craft.disarm)

        def far() -> None:
            craft.carry(far=True)

        def silent() -> None:
            craft.go_silent()
            air.later(rng.choice((1.0, 4.0, 8.0, 30.0)), craft.come_back)

        def back_changed() -> None:
            silent()
            air.later(0.5, rng.choice((armed, far)))

        acts = {
            "armed": armed, "far": far, "near": lambda: craft.carry(far=False), "silent": silent,
            "reboot": lambda: craft.vehicle.reboot(air.now), "back changed": back_changed,
        }  # fmt: skip
        self._do(kind, seat, acts[kind])

    def _edit(self, seat: Seat) -> None:
        self._do("edited", seat, lambda: seat.craft.edit(self.rng))

    def _another(self, seat: Seat, *, near: bool) -> Craft:
        rng, vehicle = self.rng, seat.craft.vehicle
        autopilot = vehicle.autopilot if rng.random() < 0.8 else rng.choice(list(Autopilot))
        home = vehicle.home if near else Home.at(36.9, -84.0, 250.0)
        one = Craft(
            self._vehicle(vehicle.sysid, autopilot, home, compid=1 if rng.random() < 0.85 else rng.choice((2, 154))),
            self.air, self._signing() if rng.random() < 0.5 else None,
        )  # fmt: skip
        one.start, one.expected = seat.craft.start, seat.craft.expected
        one.vehicle.armed = rng.random() < 0.5
        if rng.random() < 0.5:
            one.vehicle.load(seat.mission.wire_items() if rng.random() < 0.3 else seat.craft.vehicle.items())
        seat.others.append(one)
        return one

    def _twin(self, seat: Seat) -> None:
        """Add another vehicle with the same system id, at an address of its own or at the same one."""
        air, rng = self.air, self.rng
        address = seat.address if rng.random() < 0.3 else f"twin of {seat.craft.vehicle.sysid}"

        def comes() -> None:
            one = self._another(seat, near=rng.random() < 0.5)
            one.hub.on_timer(air.now - rng.choice((30.0, 400.0, 5000.0)))  # switched on before
            self._put(one, address)

        self._do(f"a twin at {address} of", seat, comes)

    def _swap(self, seat: Seat) -> None:
        """Remove the vehicle, then let another one send from its address."""
        air, rng = self.air, self.rng

        def goes() -> None:
            there = air.at(seat.address)
            if seat.craft in there:
                there.remove(seat.craft)
            seat.craft.left_at = air.now
            air.later(rng.choice((0.5, 2.0, 5.0, 15.0)), comes)

        def comes() -> None:
            one = self._another(seat, near=rng.random() < 0.3)
            self._put(one, seat.address)

        self._do("replaced", seat, goes)

    def _forge(self, seat: Seat) -> None:
        air, rng = self.air, self.rng
        polite = rng.random() < 0.3
        address = seat.address if polite else rng.choice((f"forger of {seat.craft.vehicle.sysid}", "address 1"))
        if address == seat.address and not polite:
            address = "elsewhere"
        forger = Forger(air, address, seat.craft.vehicle.address, rng, polite=polite)
        at = self._when()
        for n in range(rng.choice((1, 20, 120))):
            air.later(at + n * rng.choice((0.01, 0.1, 0.5)), forger.speak)
        self.happened.append(f"forger at {address} from {at:.2f} s, polite {polite}")

    # frames written and heard

    def _written(self, peer: Peer, data: bytes) -> None:
        kind = data[7] | data[8] << 8 | data[9] << 16
        if kind not in (*WRITES, REQUEST_LIST, ACK):
            return
        for message in self._parser.feed(data, datagram=True):
            packet = wire.decode(message)
            assert packet is not None
            seat = self.seats.get(packet.target.sysid)
            if seat is None:
                self.found.append(f"misdelivered: {packet.message} to system {packet.target.sysid}")
            elif kind == REQUEST_LIST:
                seat.requested_at = self.air.now
            elif kind == ACK:
                seat.acked_at = self.air.now
            else:
                seat.wrote += 1
                self._judge_write(seat, peer, packet.target, kind)

    def _judge_write(self, seat: Seat, peer: Peer, to: Address, kind: int) -> None:
        now, what = self.air.now, {COUNT: "an announcement", ITEM: "an item", CLEAR: "a clearing"}[kind]
        there = [o for o in self.air.at(peer) if isinstance(o, Craft) and o.vehicle.sysid == seat.mission.sysid]
        if seat.pinned is None:
            seat.checked, seat.pinned, seat.to = self._found(seat, there), peer, to
        kinds: list[str] = []
        voice = self.voices.get((to, peer), Voice())
        if peer != seat.pinned:
            kinds.append("a twin at another address")
        elif now - voice.last > LOOKED_S:
            kinds.append("one that is silent")
        elif not voice.looked_at:
            kinds.append("one that came after a silence and was not looked at")
        for one in there:
            if one.armed_reported < now and kind != ITEM and not self.options.allow_armed:
                kinds.append("one that was heard to be armed")
            # Positions of a component count only after its heartbeat, which identifies it as an autopilot.
            if one.far_reported < now and one.known_since < now and not self.options.ignore_position:
                kinds.append("one that was heard to be 33 km away")
            if one is not seat.checked and seat.checked in there:
                least = min(one.together, seat.checked.together if seat.checked else 0)
                if least > ALIKE_FRAMES and one.known_since < now:
                    kinds.append("two at one address")
        self.found += [f"misdelivered at {now - 1000.0:.2f} s: {what} to {words}" for words in kinds]

    def _found(self, seat: Seat, there: list[Craft]) -> Craft | None:
        """The craft that was checked: ours if it was heard recently, else the one at the address heard last."""
        heard = [one for one in there if one.known_since < self.air.now]
        if seat.craft in heard and self.air.now - seat.craft.last_heard <= SILENCE_S:
            return seat.craft
        return max(heard, key=lambda one: one.last_heard, default=None)

    def _heard(self, by: object, peer: Peer, message: Any) -> None:
        source = Address(message.get_srcSystem(), message.get_srcComponent())
        self.voices.setdefault((source, peer), Voice()).heard(message.get_type(), self.air.now)
        if not isinstance(by, Craft):
            return
        by.heard(message)
        seat = self.seats[by.vehicle.sysid]
        if by is seat.craft:
            self._recorder.note(bytes(message.get_msgbuf()))
        beside = [o for o in (seat.craft, *seat.others) if o is not by and self._same_address(o, by)]
        by.together = by.together + (message.get_type() == "GLOBAL_POSITION_INT") if beside else 0

    def _same_address(self, a: Craft, b: Craft) -> bool:
        there = self.air.at(b.address)
        return a in there and b in there

    # the run

    def go(self) -> tuple[list[uploads.JobResult], list[str]]:
        """Run the upload; return the results and the findings."""
        if self.key and self.rng.random() < 0.5:
            self._play_again()
        began = self.air.now
        for seat in self.seats.values():
            seat.began, seat.checked, seat.pinned = began, None, None
            for one in (seat.craft, *seat.others):
                one.forget()
        self.voices.clear()
        jobs = [uploads.UploadJob(s.mission.name, URL, s.mission) for s in self.seats.values()]
        try:
            with self._links():
                results = uploads.run_jobs(jobs, self.options)
        except Hang as hang:
            return [], [*self.found, f"hang: {hang}"]
        except Exception as error:
            logging.getLogger(__name__).exception("seed %d", self.seed)
            return [], [*self.found, f"crash: {type(error).__name__}: {error}"]
        took_s = self.air.now - began
        longest_s = self._longest_s()
        if took_s > longest_s:
            self.found.append(f"hang: {took_s:.1f} s, {longest_s:.1f} s are allowed")
        for d, seat in zip(results, self.seats.values(), strict=True):
            self._judge(d, seat)
        return results, self.found

    def _longest_s(self) -> float:
        timeout_s = self.options.timeout_s
        find_s = min(FIND_S, timeout_s) + min(STANDBY_S, timeout_s) + 4.0
        items = max(len(s.mission.wire_items()) for s in self.seats.values())
        upload_s = find_s + PARAMETERS_S + timeout_s + 2.0 * items + LAST_LOOK_S + 2.0
        clear_s = find_s + timeout_s + 2.0 + timeout_s + 2.0 * 650 + 2.0
        return upload_s + (clear_s if self.options.atomic else 0.0)

    @contextlib.contextmanager
    def _links(self) -> Iterator[None]:
        opened = uploads.open_link

        def link(url: str) -> Link:
            return self.air.link(self._signing())

        uploads.open_link = link
        try:
            yield
        finally:
            uploads.open_link = opened

    def _play_again(self) -> None:
        """Record a first, good upload; then empty the vehicle, remove it or not, and replay the recording."""
        rng, air = self.rng, self.air
        seat = self.seats[1]
        with self._links():
            uploads.run_jobs([uploads.UploadJob(seat.mission.name, URL, seat.mission)], self.options)
        seat.craft.vehicle.load(())
        seat.craft.look()
        if rng.random() < 0.5:
            there = air.at(seat.address)
            there[:] = [one for one in there if one is not seat.craft]
            seat.craft.left_at = air.now
        self._recorder.replay(rng.choice((seat.address, "recorder")), rng.uniform(0.0, 3.0), Recorder.MOST)
        seat.requested_at = seat.acked_at = air.now

    def _judge(self, d: uploads.JobResult, seat: Seat) -> None:
        now, checked = self.air.now, seat.checked
        if d.code == GcsplanError.exit_code:
            self.found.append(f"crash: {d.vehicle}: {d.message}")
        here = [o for o in (seat.craft, *seat.others) if seat.pinned and o in self.air.at(seat.pinned)]
        there = [o for o in (checked, *here) if o is not None]
        if d.verified and not any(o.was_equal(seat.requested_at, now) for o in there):
            self.found.append(f"false verified: {d.vehicle}: {d.as_dict()}")
        if d.code == 0 and d.verified and not any("after the read-back" in str(w) for w in d.warnings):
            self.found += [f"untold: {d.vehicle} {words}, and exit 0" for words in self._untold(seat, here)]

    def _untold(self, seat: Seat, here: list[Craft]) -> Iterator[str]:
        """Facts that the ground station has heard and should have reported."""
        checked, until = seat.checked, seat.acked_at
        voice = self.voices.get((seat.to, seat.pinned), Voice()) if seat.to else Voice()
        looked_at = voice.look_after(until)
        if looked_at == math.inf:
            yield "was not looked at after the read-back"
        for o in here:
            if o.armed_reported <= looked_at and not self.options.allow_armed:
                yield "was heard to be armed"
            if o.far_reported <= looked_at and o.known_since <= looked_at and not self.options.ignore_position:
                yield "was heard to be 33 km away"
        if checked is None:
            return
        for o in (seat.craft, *seat.others):
            # Heard while the checked vehicle was there: a rival, at whatever address.
            apart = (o.vehicle.compid, o.address) != (checked.vehicle.compid, checked.address)
            since = max(seat.began, checked.there_since) + 0.1
            if o is not checked and apart and o.heard_between(since, min(until, checked.left_at)):
                yield "has a twin that was heard"


def one(seed: int) -> tuple[Counter[str], list[str]]:
    """Run ``seed``; return counts of its results, and each finding with the events of the run."""
    run = Run(seed)
    results, found = run.go()
    counts = Counter(
        {"uploads": len(run.seats), "runs": 1, "packets written": sum(s.wrote for s in run.seats.values())}
    )
    for d in results:
        counts[f"exit {d.code}"] += 1
        counts["verified"] += d.verified
        counts["changed"] += bool((d.details or {}).get("changed"))
        counts["more than one attempt"] += (d.details or {}).get("attempts", 1) > 1
    return counts, [f"seed {seed}: {words} [{'; '.join(run.happened)}]" for words in found]


def campaign(seeds: range | Iterator[int], until: float = float("inf")) -> tuple[Counter[str], list[str]]:
    """Run all ``seeds`` until ``until`` (time.monotonic) or 50 findings; return counts and findings."""
    counts: Counter[str] = Counter()
    found: list[str] = []
    logging.disable(logging.ERROR)
    try:
        for seed in seeds:
            if time.monotonic() >= until or len(found) >= 50:
                break
            more, words = one(seed)
            counts += more
            found += words
    finally:
        logging.disable(logging.NOTSET)
    return counts, found


def main() -> int:
    """Run the campaign from the command line; return 1 on findings, or if no upload was verified."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="how long [default: until --runs are done]")
    parser.add_argument("--runs", type=int, default=10_000, help="at most this many runs [default: 10000]")
    parser.add_argument("--seed", type=int, default=1, help="the first seed [default: 1]")
    given = parser.parse_args()
    began = time.monotonic()
    counts, found = campaign(range(given.seed, given.seed + given.runs), began + given.seconds)
    print(f"links: seeds from {given.seed}, {time.monotonic() - began:.0f} s")
    for name, count in sorted(counts.items()):
        print(f"  {name:24s} {count}")
    for words in found:
        print(words)
    print(f"{len(found)} found")
    return 1 if found or not counts["verified"] else 0


if __name__ == "__main__":
    sys.exit(main())


__all__ = ["Address", "campaign", "one"]
