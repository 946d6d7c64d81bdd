"""The order of proposals for the way home, and their words and keys."""

from __future__ import annotations

import itertools

from gcsplan.check.returns.proposal import ReturnProposal, best_first
from gcsplan.notes.note import Note


def proposal(leaves_m: float, *, above: bool = False, shortens: bool = False) -> ReturnProposal:
    """A return altitude that leaves so much unsafe."""
    change = Note("land_earlier", lat=46.0, lon=14.0, before_m=120.0, with_change=None)
    return ReturnProposal(change, leaves_m, (("goal", (46.0, 14.0)), ("via", ())), above, shortens)


def test_the_best_leaves_least_keeps_the_limits_and_ends_at_the_goal() -> None:
    best = [
        proposal(0.0), proposal(0.0, above=True), proposal(300.0), proposal(576.0), proposal(0.0, shortens=True)
    ]  # fmt: skip
    for shuffled in itertools.permutations(best):
        assert list(best_first(shuffled)) == best


def test_of_proposals_that_are_alike_to_a_metre_the_first_stays_the_first() -> None:
    first, second = proposal(100.3), proposal(99.9)
    assert best_first([first, second]) == (first, second)
    assert best_first([second, first]) == (second, first)


def test_a_proposal_says_what_it_leaves_and_has_the_keys_that_make_it() -> None:
    told = proposal(576.0).as_dict()
    assert told["leaves_m"] == 576.0
    assert told["keys"] == {"goal": [46.0, 14.0], "via": []}
    assert "576 m" in str(told["proposal"])
    assert "576 m" not in str(proposal(0.0).as_dict()["proposal"])
