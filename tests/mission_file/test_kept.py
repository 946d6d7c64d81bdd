"""What a session keeps: the values made last, each under all that it was made of."""

from __future__ import annotations

from gcsplan.errors import Mistake
from gcsplan.mission_file.kept import KeptWorld, Latest


def test_the_latest_values_are_made_once_and_the_oldest_is_forgotten() -> None:
    made: list[int] = []
    latest: Latest[int] = Latest(2)

    def value(key: int) -> int:
        return latest.get(key, lambda: made.append(key) or key * 10)  # type: ignore[func-returns-value]

    assert [value(k) for k in (1, 2, 1, 3, 1, 2)] == [10, 20, 10, 30, 10, 20]
    assert made == [1, 2, 3, 2]
    assert len(latest.known) == 2


def test_zones_are_read_again_when_their_entry_changes_or_has_a_mistake() -> None:
    kept, read = KeptWorld(), []

    def zones(key: str, wrong: bool = False) -> None:
        kept.begin()
        mistakes = [Mistake("no_fly[0]", "wrong")] if wrong else []
        kept.zones("no_fly[0]", key, lambda: (read.append(key) or [], [], mistakes))  # type: ignore[func-returns-value]

    for key, wrong in (("a", False), ("a", False), ("b", True), ("b", False), ("b", False)):
        zones(key, wrong)
    assert read == ["a", "b", "b"]
