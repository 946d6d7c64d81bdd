"""A verdict as plain values, for programs."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest

from gcsplan.app.check.verdict_json import extremes, flat, verdict_of
from gcsplan.app.plan.way_home import homes_of
from gcsplan.notes.note import Wording
from tests.support.pages import planned, small_page


def test_a_verdict_is_plain_values_with_data_beside_each_sentence() -> None:
    verdict = small_page().subjects[0].verdict
    told = json.loads(json.dumps(verdict_of("a.plan", verdict, wording=Wording(options={"max_agl_m": "--max-agl"}))))
    assert (told["file"], told["vehicle"], told["safe"]) == ("a.plan", "uav1", True)
    assert told["items"] == len(verdict.mission.wire_items())
    assert told["length_m"] == verdict.length_m
    assert told["min_agl_m"] == verdict.lowest.min_agl_m if verdict.lowest else None
    assert len(told["notes"]) == len(told["notes_data"]) == len(verdict.notes)
    assert any("--max-agl" in sentence for sentence in told["notes"])
    assert told["violations"] == []


def test_a_broken_limit_has_its_place_its_excess_and_its_code() -> None:
    told = verdict_of("low.plan", small_page(low_m=350.0).subjects[0].verdict)
    assert told["safe"] is False
    assert {"seq", "kind", "message", "by", "unit", "code", "data"} <= set(told["violations"][0])
    assert told["verdict"].startswith("path UNSAFE")


def test_extremes_name_the_zone_that_is_passed_and_the_one_that_is_nearest() -> None:
    verdict = small_page().subjects[0].verdict
    told = extremes(verdict)
    assert told["zone_passed"]["zone"] in ("mast", "training area")
    assert told["zone_passed"]["side"] in ("over", "under")
    assert told["min_zone_height_m"] > 0.0
    assert told["max_agl_m"] == max(leg.max_agl_m for leg in verdict.legs)


@pytest.mark.slow
def test_the_way_home_decides_the_words() -> None:
    plan = planned()
    [v] = plan.vehicles
    home = homes_of(plan)[v.name]
    assert verdict_of("", v.verdict)["verdict"] == "path safe, return not judged"
    assert verdict_of("", v.verdict, home)["verdict"] == str(home.headline)


def test_fields_are_taken_as_they_are() -> None:
    @dataclass(slots=True)
    class Two:
        first: int
        second: list[int]

    kept = [1]
    assert flat(Two(1, kept)) == {"first": 1, "second": [1]}
    assert flat(Two(1, kept))["second"] is kept
