"""What the page is sent of a plan has the plan's own numbers, and no number that JSON lacks."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.session import BetterPath
from gcsplan.check.verdict import LegFigures
from gcsplan.errors import InputError, Mistake, NoMission
from gcsplan.page import answers
from gcsplan.planners.problem import gap_percent
from gcsplan.units import IMPERIAL, METRIC

MISSION: dict[str, Any] = {
    "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30},
    "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [46.5, 8.5], "goal": [46.51, 8.5]}],
}  # fmt: skip


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(MISSION)


def test_a_certificate_has_the_plan_s_numbers_and_words_in_units(planned: Plan) -> None:
    [own] = planned.vehicles
    found = json.loads(json.dumps(answers.plan_answer(3, planned, {}, IMPERIAL, 0.25), allow_nan=False))
    [vehicle] = found["vehicles"]
    assert (found["n"], found["verdict"], found["elapsed_ms"]) == (3, "safe", 250.0)
    assert (vehicle["length_m"], vehicle["bound"]) == (own.verdict.length_m, own.solution.lower_bound)
    figures = {figure["key"]: figure for figure in vehicle["figures"]}
    assert figures["least_agl"]["text"].endswith(" ft")
    assert figures["energy"]["text"] == "not given"
    assert figures["nearest_zone"]["text"] == "none"


def test_a_profile_has_the_height_above_ground_to_a_centimetre() -> None:
    planned = plan({**MISSION, "terrain": {"flat_m": 100.24}})
    [found] = answers.plan_answer(1, planned, {}, METRIC, 0.0)["vehicles"]
    agl_m = np.subtract(found["profile"]["path_m"], found["profile"]["ground_m"])
    highest = planned.vehicles[0].verdict.highest
    assert highest is not None
    assert agl_m.max() == pytest.approx(highest.max_agl_m, abs=0.0101)


def test_a_mission_that_breaks_a_limit_is_never_called_safe(planned: Plan) -> None:
    [own] = planned.vehicles
    unjudged = replace(own, verdict=replace(own.verdict, not_judged=own.verdict.notes[:1] or own.all_notes(None)[:1]))
    assert unjudged.verdict.not_judged, "this mission has a note to borrow"
    found = answers.plan_answer(1, replace(planned, vehicles=(unjudged,)), {}, METRIC, 0.0)
    assert (found["verdict"], found["vehicles"][0]["verdict"]) == ("not judged", "not judged")
    assert {f["key"]: f["bad"] for f in found["vehicles"][0]["figures"]}["verdict"] is True


def test_a_required_way_home_that_is_not_judged_is_not_safe() -> None:
    found = answers.plan_answer(1, plan({**MISSION, "way_home": "required"}), {}, METRIC, 0.0)
    assert found["verdict"] == "not judged"


def test_unknown_ground_is_null_and_no_nan(planned: Plan) -> None:
    [own] = planned.vehicles
    blind: tuple[LegFigures, ...] = tuple(
        replace(leg, min_agl_m=float("nan"), max_agl_m=float("nan"), min_agl_at=(float("nan"), 0.0))
        for leg in own.verdict.legs
    )
    verdict = replace(own.verdict, legs=blind)
    found = answers.plan_answer(1, replace(planned, vehicles=(replace(own, verdict=verdict),)), {}, METRIC, 0.0)
    assert "NaN" not in json.dumps(found)
    assert {f["key"]: f["text"] for f in found["vehicles"][0]["figures"]}["least_agl"] == "unknown"


def test_paths_and_gaps_are_plain_numbers() -> None:
    path = BetterPath("a", np.array([46.5, 46.6]), np.array([8.5, 8.6]), np.array([150.0, 160.004]), 110.0, 100.0, 0.02)
    found = answers.path_answer(1, 0, path, live=True, first=True)
    assert found["line"] == [46.5, 8.5, 150.0, 46.6, 8.6, 160.0]
    assert found["gap_percent"] == pytest.approx(10.0)
    assert gap_percent(None, 100.0) is gap_percent(100.0, None) is gap_percent(1.0, 0.0) is None
    assert answers.bound_answer(1, 0, 100.0, 99.9)["gap_percent"] == 0.0


def test_a_refusal_has_its_place_and_cures_as_changes() -> None:
    why = NoMission("no", reason="infeasible", vehicle="uav1", at=(46.5, 8.5), cures=((("max_agl_m", 90.0),),))
    found = answers.refused_answer(4, why, {"limits": {"max_agl_m": 80}}, METRIC, live=False)
    assert (found["at"], found["reason"]) == ([46.5, 8.5], "infeasible")
    assert found["cures"] == [{"label": "limits.max_agl_m: 90", "changes": {"limits.max_agl_m": 90.0}}]


def test_an_error_names_the_key_without_the_file() -> None:
    why = InputError.of([Mistake("/a/b.yaml: limits.min_agl_m", "must be"), Mistake("/a/b.yaml: name", "must not")])
    found = answers.error_answer(1, why, "bad_mission")
    assert (found["where"], found["message"]) == ("limits.min_agl_m", "limits.min_agl_m: must be\nname: must not")


def test_of_many_vehicles_verdicts_are_counted_and_one_profile_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    second = {**MISSION["vehicles"][0], "name": "uav2", "sysid": 2, "start": [46.5, 8.52], "goal": [46.51, 8.52]}
    planned = plan({**MISSION, "vehicles": [*MISSION["vehicles"], second]})
    both = answers.plan_answer(1, planned, {}, METRIC, 0.0, 1)["vehicles"]
    assert answers.profile_answer(2, planned, 0) is None  # it came with the plan
    monkeypatch.setattr("gcsplan.page.answers.MOST_PROFILES", 1)
    whole = answers.plan_answer(1, planned, {}, METRIC, 0.0, 1)
    assert whole["headline"] == "2 vehicles: path safe, return not judged"
    found = whole["vehicles"]
    assert [v["profile"] for v in found] == [None, both[1]["profile"]]
    later = answers.profile_answer(2, planned, 0)
    assert later is not None
    assert (later["vehicle"], later["profile"]) == (0, both[0]["profile"])
    assert answers.profile_answer(2, planned, 2) is None
    assert len(json.dumps(found)) < 0.6 * len(json.dumps(both))
