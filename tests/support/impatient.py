"""Short timeouts for command line uploads in tests, where answers come at once or never."""

from __future__ import annotations

from functools import partial

import pytest

from gcsplan.app.upload import run as uploads
from gcsplan.mavlink.link.session import session, steps
from gcsplan.mavlink.protocol.transfer import Timers

_OPTIONS = session.SessionOptions


def be_impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Listen only 0.1 s for a second vehicle with the same system id, and wait 0.3 s for each response.

    Parameters are requested again after 0.1 s, and given up after 0.3 s where nothing depends on them.
    """
    for name, seconds in (("ASK_AGAIN_S", 0.1), ("PARAMETER_S", 0.3), ("NO_PARAMETERS_S", 0.3)):
        monkeypatch.setattr(steps, name, seconds)
    monkeypatch.setattr(uploads, "LISTEN_S", 0.1)
    monkeypatch.setattr(session, "SessionOptions", partial(_OPTIONS, timers=Timers(response_s=0.3)))
