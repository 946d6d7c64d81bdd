"""A page's part of the conversation with the map's session, without a server."""

from __future__ import annotations

import json
import queue
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gcsplan.page.edits import Edits
from gcsplan.page.map_session import MapSession
from gcsplan.page.steps.flight_steps import PageSteps
from gcsplan.units import METRIC

ANSWER_S = 20.0
FLAT = """\
# head
version: 1
name: field
terrain: {flat_m: 100}
limits: {min_agl_m: 30}   # of all
no_fly:
  - {name: mast, center: [46.505, 8.5], radius_m: 150}   # the mast
  - {name: pond, polygon: [[46.502, 8.505], [46.503, 8.505], [46.503, 8.507]]}   # the pond
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    start: [46.5, 8.5]   # the meadow
    goal: [46.51, 8.51]
"""


class Desk:
    """A session without a server: what a page sends and hears."""

    def __init__(self, session: MapSession) -> None:
        self.session, self.n = session, 0
        self._answers: queue.Queue[dict[str, Any]] = queue.Queue()
        self.heard: list[dict[str, Any]] = []
        session.attach(self._answers.put)

    def send(self, kind: str, **more: Any) -> None:
        self.n += 1
        self.session.hand_in({"type": kind, "n": self.n, **more})

    def until(self, *kinds: str) -> dict[str, Any]:
        """The next answer of one of these kinds to the newest message."""
        while True:
            answer = self._answers.get(timeout=ANSWER_S)
            json.dumps(answer, allow_nan=False)
            self.heard.append(answer)
            if answer["type"] in kinds and answer["n"] == self.n:
                return answer
            assert answer["type"] != "error" or answer["n"] != self.n, answer["message"]

    def ask(self, kind: str, *until: str, **more: Any) -> dict[str, Any]:
        self.send(kind, **more)
        return self.until(*until)


@contextmanager
def desk_of(mission: Path | None, folder: Path) -> Iterator[Desk]:
    session = MapSession(Edits.of_folder(folder) if mission is None else Edits.of_file(mission), METRIC, PageSteps)
    try:
        yield Desk(session)
    finally:
        session.close()
