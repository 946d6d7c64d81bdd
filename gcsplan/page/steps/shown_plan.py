"""`ShownPlan`: the plan that the page shows, by its number, and whether the mission is still the same."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gcsplan.app.plan.model import Plan
from gcsplan.errors import InputError
from gcsplan.mission_file.kept import KeptWorld
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.request import MissionFile
from gcsplan.page.edits import Edits
from gcsplan.page.refused import PageError


@dataclass(frozen=True, eq=False)
class ShownPlan:
    """A plan with the number under which the page knows it.

    ``folder`` is for its outputs; ``saved``: the mission file holds it. Both are as they were when a step began.
    """

    number: int
    plan: Plan
    folder: Path = Path()
    saved: bool = False

    def for_step(self, edits: Edits, number: object) -> ShownPlan:
        """The plan as a step takes it. Raises PageError unless ``number`` names this plan, and neither edits nor files
        have changed since."""
        if number != self.number or isinstance(number, bool):
            raise _refused("the mission was planned anew since: look at the new plan first")
        content = self.plan.source.content
        planner = edits.planner
        if edits.live or content is None or planner is None or planner.mission != content.given:
            raise _refused("the mission was changed since it was planned: wait for the new plan")
        if edits.store.disk() in ("changed", "gone"):
            name = edits.store.place.name
            raise _refused(f"{name} was changed on the disk: take the file, or save over it")
        try:
            now = load_content(content, KeptWorld())
        except InputError as why:
            raise _refused(f"the mission's files were changed on the disk: {why.message}") from None
        if _sums(now) != _sums(self.plan.source):
            raise _refused("the terrain, the zones or the wind were changed on the disk: take the file again")
        store = edits.store
        return replace(self, folder=store.folder / store.place.stem, saved=store.file is not None and edits.is_saved)


def _sums(source: MissionFile) -> dict[str, Any]:
    """What identifies the files that a mission was read from."""
    sums: dict[str, Any] = {key: value for key, value in source.inputs.items() if key.endswith("sha256")}
    return sums | {"forecast": [note.data.get("sha256") for note in source.notes if note.code == "wind_of_forecast"]}


def _refused(words: str) -> PageError:
    return PageError(f"nothing was sent or written: {words}", code="not_sent")
