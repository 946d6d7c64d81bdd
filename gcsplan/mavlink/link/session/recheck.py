"""Repeated checks that the vehicle we write to is still the one that was checked, and in the same state.

Preflight runs once, but a transfer takes minutes on a bad link. Meanwhile the vehicle may be armed, carried away or
switched off, and another one with its system id may appear. So its address on the link is pinned, messages from other
addresses under its system id are ignored, and preflight is repeated

- before each write: each COUNT and each CLEAR_ALL (`gate`);
- on each incoming message: a vehicle at another place, of another type, or two at the same address end the transfer;
- after a silence, before another item is sent: the vehicle that is heard then may be another one;
- after the read-back (`last_look`).

A look needs a recent heartbeat, and a recent position if the vehicle reports any: received at most 1.5 s (`_RECENT_S`)
before the look began, or after it began for `last_look`. Both are requested.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.link.link import Channel, Heard, LinkSteps
from gcsplan.mavlink.link.session.preflight import NEAR_START_M, Reasons, apart_m
from gcsplan.mavlink.link.watch import FRESH_S, VehicleState, Watch
from gcsplan.mavlink.protocol.machine import Wait
from gcsplan.mavlink.protocol.messages import MissionMessage, Request
from gcsplan.mavlink.protocol.outcome import Changed, Outcome, Unknown
from gcsplan.notes.note import Note

StateJudge = Callable[[VehicleState], tuple[Reasons, list[Note]]]

RECHECK_LOOK_S = 10.0
"""Seconds that a look waits for a vehicle that has fallen silent."""
_TELLING = frozenset({"HEARTBEAT", "GLOBAL_POSITION_INT", "GPS_RAW_INT", "ATTITUDE", "SYSTEM_TIME"})
_RECENT_S = 1.5
ASK_AGAIN_S = 0.5
_AGAIN_S = 0.1
_REQUEST_MESSAGE, _HEARTBEAT, _GLOBAL_POSITION_INT = 512, 0, 33
_MOVED = frozenset({"wrong_place", "wrong_height"})
_ENDS_AT_ONCE = frozenset({"wrong_place", "wrong_autopilot"})
"""Reasons that end a running transfer: it may be another vehicle. One that was only armed still gets its whole list."""


class Recheck:
    """Follows the vehicle in ``state``, which was found on ``channel`` and has passed ``judge``.

    ``may_move``: its position may change. ``standby_s``: seconds to wait for a vehicle that reboots.
    """

    def __init__(
        self,
        channel: Channel,
        watch: Watch,
        state: VehicleState,
        judge: StateJudge,
        *,
        may_move: bool = False,
        standby_s: float = 0.0,
    ) -> None:
        now = channel.link.clock()
        watch.pin(state, now)
        channel.pin(state.peer)
        self._channel, self._watch, self._judge = channel, watch, judge
        self._address = state.address
        self._first = state
        self._may_move = may_move
        self._longest_s = max(RECHECK_LOOK_S, standby_s)
        self._contact = now
        self._shut = False
        self._silent_until = -math.inf
        self._news = False
        self._stop: Outcome | None = None
        self._began: float | None = None  # start of the current look
        self._since = 0.0
        self._ask_at = -math.inf

    @property
    def watch(self) -> Watch:
        """The watch over the vehicle's messages."""
        return self._watch

    @property
    def texts(self) -> tuple[str, ...]:
        """The vehicle's status texts."""
        return tuple(self._watch.texts)

    # called by `drive`

    @property
    def shut(self) -> bool:
        """Whether the vehicle was silent for `FRESH_S`, so that nothing is answered before the next look."""
        return self._shut

    @property
    def wary(self) -> bool:
        """Whether requests must be checked before they are answered, because there may be two vehicles."""
        return self._shut or self._stop is not None or self._watch.contested

    @property
    def deadline(self) -> float:
        """The next time to call `stops`."""
        if self._began is not None:
            return min(self._ask_at, self._channel.link.clock() + _AGAIN_S)
        return math.inf if self._shut else self._contact + FRESH_S

    def note(self, heard: Heard, now: float) -> None:
        """Record any message received under the vehicle's system id."""
        if heard.peer == self._channel.peer and heard.source == self._address and not heard.late:
            self.contact(now)
        self._watch.note(heard, now)
        self._news = self._news or heard.message.get_type() in _TELLING or self._watch.contested

    def contact(self, now: float) -> None:
        """Record that the vehicle was heard at its address."""
        self._shut_after_silence(now)
        self._contact = now

    def admits(self, heard: Heard, message: MissionMessage, now: float) -> bool:
        """Whether a mission message counts, which requires that it comes from the vehicle's address.

        A request also requires that no message so far, itself included, shows another vehicle, and that the vehicle was
        not silent since the last look.
        """
        if heard.peer != self._channel.peer or not isinstance(message, Request):
            return heard.peer == self._channel.peer
        self._judge_news(now)
        return self._stop is None and not self._shut

    def stops(self, now: float) -> Outcome | None:
        """Return the outcome with which the transfer must end now; None if it may go on. Sends requests for a look."""
        self._shut_after_silence(now)
        self._judge_news(now)
        if self._stop is None and self._shut and self._contact > self._silent_until:
            seen = self._look(now)
            self._stop = None if isinstance(seen, Wait) else seen
        self._ask(now)
        return self._stop

    def gate(self, now: float) -> Wait | Outcome | None:
        """Return whether a write is permitted at ``now``: a `machine.Gate`."""
        return self._stop or self._look(now)

    # looks

    def last_look(self) -> LinkSteps[Outcome | None]:
        """Look after the read-back: return `Changed`, None if nothing changed, or `Unknown` after silence."""
        clock = self._channel.link.clock
        self._longest_s, self._began = RECHECK_LOOK_S, None
        self._begin(clock(), clock())
        while isinstance(seen := self._look(clock(), boots=True), Wait):
            self._ask(clock())
            yield seen.until
            for heard in self._channel.take():
                self.note(heard, clock())
        return self._stop or seen

    def _begin(self, now: float, since: float) -> None:
        if self._began is None:
            self._began, self._since, self._ask_at = now, since, now

    def _look(self, now: float, *, boots: bool = False) -> Wait | Outcome | None:
        state = self._watch.state(now)
        since = now - _RECENT_S if self._began is None else self._since
        since = max(since, self._watch.newcomer_at())  # hear ours after a newcomer appears, to see that there are two
        if state is None or state.beat_at < since or (state.located and state.placed_at < since):
            self._begin(now, since)
            return self._waits(now) or Unknown(self._unseen(state, since))
        against = self._objections(state)
        if not boots and against and all(word == "not_ready" for word, _ in against):
            self._begin(now, since)
            self._since = now - _RECENT_S
            if waits := self._waits(now):
                return waits
        self._began, self._shut = None, False
        return _changed(against)

    def _waits(self, now: float) -> Wait | None:
        assert self._began is not None
        return Wait(now + _AGAIN_S) if now < self._began + self._longest_s else None

    def _unseen(self, state: VehicleState | None, since: float) -> str:
        silent = state is None or state.beat_at < since
        what = "the vehicle fell silent" if silent else "the vehicle no longer reports its position"
        if silent and self._watch.newcomer_at() > -math.inf:
            what += f", and another one is heard as system {self._address.sysid} now"
        return f"{what}: it could not be checked again, and nothing further was sent"

    def _objections(self, state: VehicleState) -> Reasons:
        against, _ = self._judge(state)
        if not self._first.located and state.located:
            self._first = state  # its position was not known at first: compare with the first one reported
        first = self._first
        if not self._may_move and not first.armed and not any(word in _MOVED for word, _ in against):
            away_m = apart_m(first, state)
            if away_m is not None and away_m > NEAR_START_M:
                against.append(("wrong_place", f"the vehicle is {away_m:.0f} m from where it was checked"))
        return against

    def _judge_news(self, now: float) -> None:
        if self._news:
            self._news = False
            self._stop = self._stop or self._another(now)

    def _another(self, now: float) -> Outcome | None:
        """Return the outcome if messages from the vehicle's address show another or a second vehicle; else None."""
        state = self._watch.state(now)
        if state is None:
            return None
        found = [(word, text) for word, text in self._objections(state) if word in _ENDS_AT_ONCE]
        if not self._watch.alike():
            words = f"two vehicles speak as system {self._address.sysid} from the same address"
            found.append(("ambiguous", words))
        return _changed(found)

    def _shut_after_silence(self, now: float) -> None:
        if not self._shut and now >= self._contact + FRESH_S:
            self._shut, self._silent_until = True, self._contact
            self._began = None

    def _ask(self, now: float) -> None:
        if self._began is None or now < self._ask_at:
            return
        self._ask_at = now + ASK_AGAIN_S
        for kind in (_HEARTBEAT, _GLOBAL_POSITION_INT):
            self._channel.send(request_message(self._address, kind), self._address)


def request_message(to: Any, kind: int) -> Any:
    """Return MAV_CMD_REQUEST_MESSAGE to ``to`` for one message with the id ``kind``."""
    return dialect.MAVLink_command_long_message(*to, _REQUEST_MESSAGE, 0, kind, 0, 0, 0, 0, 0, 0)


def _changed(against: Reasons) -> Changed | None:
    if not against:
        return None
    word = "moved" if against[0][0] in _MOVED else against[0][0]
    return Changed(word, "; ".join(text for _, text in against))
