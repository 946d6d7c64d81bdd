"""Uploads of the command line on links where answers come at once or never, so that nobody need wait long for one."""

from __future__ import annotations

from functools import partial

import pytest

from gcsplan.app import uploads
from gcsplan.mavlink.link import session
from gcsplan.mavlink.protocol.transfer import Timers

_OPTIONS = session.SessionOptions


def be_impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Listen for rivals, of whom there are none, and wait for answers of vehicles in this process, but shortly."""
    monkeypatch.setattr(uploads, "LISTEN_S", 0.1)
    monkeypatch.setattr(session, "SessionOptions", partial(_OPTIONS, timers=Timers(response_s=0.3)))
