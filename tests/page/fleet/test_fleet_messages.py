"""A fleet at the session of the map: its time table, a drag of one vehicle, those left out, and its view in space."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.page.fleet.scene import scene_answer
from gcsplan.page.fleet.time_table import numbers_of, time_table
from gcsplan.units import IMPERIAL, METRIC
from tests.page.test_map_session import FLAT, Desk, desk_of

SECOND = {"start": [46.5, 8.52], "goal": [46.51, 8.53]}
APART = {"arrival.mode": "sequence", "arrival.interval_s": 20, "arrival.separation_m": 30}


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    (tmp_path / "field.yaml").write_text(FLAT + "    # of uav1 alone\n")
    with desk_of(tmp_path / "field.yaml", tmp_path) as desk:
        desk.ask("hello", "plan")
        yield desk


@pytest.mark.slow
def test_a_second_vehicle_is_planned_saved_and_arrives_in_its_turn(desk: Desk, tmp_path: Path) -> None:
    found = desk.ask("change", "plan", changes={"vehicles[1]": SECOND, **APART})
    rows = found["fleet"]["rows"]
    assert [row["name"] for row in rows] == ["uav1", "uav2"]
    assert rows[1]["arrive_s"] - rows[0]["arrive_s"] == pytest.approx(20.0, abs=0.011)
    apart = found["fleet"]["separation"]
    assert apart["safe"] is True
    assert apart["text"].startswith("Separation kept: uav1 and uav2")
    assert rows[0]["nearest"] == {"name": "uav2", "distance_m": apart["closest"]["distance_m"]}
    found = desk.ask("change", "plan", changes={"arrival.order": ["uav2", "uav1"]})
    assert [row["vehicle"] for row in found["fleet"]["rows"]] == [1, 0]
    desk.ask("save", "saved")
    text = (tmp_path / "field.yaml").read_text()
    assert text.index("# of uav1 alone") < text.index("uav2")  # comments stay with their vehicle
    [own, other] = plan(load_mission(tmp_path / "field.yaml")).vehicles
    assert [v["length_m"] for v in found["vehicles"]] == [own.verdict.length_m, other.verdict.length_m]


@pytest.mark.slow
def test_only_the_vehicle_that_is_dragged_is_planned_meanwhile(desk: Desk) -> None:
    desk.ask("change", "plan", changes={"vehicles[1]": SECOND, **APART})
    desk.heard.clear()
    assert desk.ask("change", "path", changes={"vehicles[1].goal": [46.512, 8.53]}, live=True)["vehicle"] == 1
    desk.ask("change", "plan", changes={"vehicles[1].goal": [46.512, 8.53]})
    assert {answer["vehicle"] for answer in desk.heard if answer["type"] == "path" and answer["live"]} == {1}


@pytest.mark.slow
def test_a_vehicle_that_is_left_out_keeps_its_number_and_says_why(desk: Desk) -> None:
    desk.ask("change", "plan", changes={"vehicles[1]": SECOND, **APART})
    why = desk.ask("change", "refused", changes={"arrival.arrive_s": 1, "arrival.hold": "none"})
    assert {"arrival.leave_out": True} in [attempt["changes"] for attempt in why["attempts"]]
    desk.ask("undo", "plan")
    beside = {"vehicles[0].goal": [46.5101, 8.53], "arrival.mode": "none", "arrival.leave_out": True}
    found = desk.ask("change", "plan", changes=beside | {"vehicles[0].goal": SECOND["goal"]})
    assert len(found["left_out"]) == 1
    [flies] = found["vehicles"]
    assert flies["vehicle"] == {"uav1": 0, "uav2": 1}[flies["name"]]
    assert found["verdict"] != "safe"


@pytest.mark.slow
def test_the_form_is_that_of_the_chosen_vehicle(desk: Desk) -> None:
    desk.ask("change", "plan", changes={"vehicles[1]": SECOND, **APART})
    fields = {field["key"]: field["value"] for field in desk.ask("vehicle", "state", vehicle=1)["form"]}
    assert fields["vehicles[1].name"] == "uav2"
    assert "vehicles[0].name" not in fields
    state = desk.ask("change", "state", changes={"vehicles[1]": None})
    assert (state["vehicle"], [v["name"] for v in state["vehicles"]]) == (0, ["uav1"])
    desk.until("plan")
    assert desk.ask("vehicle", "error", vehicle=-1)["code"] == "bad_message"


@pytest.mark.slow
def test_the_view_in_space_is_sent_while_it_is_shown(desk: Desk) -> None:
    scene = desk.ask("scene", "scene", on=True)
    assert scene["picture"].startswith("data:image/webp;base64,")
    assert [zone["name"] for zone in scene["zones"]] == ["mast", "pond"]
    [line], [track] = scene["lines"], scene["replay"]["tracks"]
    assert (line["index"], line["name"], track["k"]) == (0, "uav1", 0)
    desk.ask("change", "scene", changes={"vehicles[1]": SECOND, **APART})
    desk.send("scene", on=False)
    desk.ask("undo", "home")
    assert desk.heard[-2]["type"] == "plan"


def test_a_fleet_in_the_file_is_shown_as_it_is(tmp_path: Path) -> None:
    document = yaml.safe_load(FLAT)
    document["vehicles"].append(document["vehicles"][0] | {"name": "b", "sysid": 2, **SECOND})
    document["arrival"] = {"mode": "together", "order": "best", "separation_ft": 100}
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(document))
    with desk_of(tmp_path / "two.yaml", tmp_path) as desk:
        state = desk.ask("hello", "state")
        assert state["arrival"] == {"mode": "together", "order": "best", "separation_m": pytest.approx(30.48)}
        first, second = desk.until("plan")["fleet"]["rows"]
        assert first["arrive_s"] == pytest.approx(second["arrive_s"], abs=0.02)


@pytest.mark.slow
def test_one_vehicle_has_a_view_in_space_and_no_time_table(tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT)
    planned = plan(load_mission(tmp_path / "field.yaml"))
    assert numbers_of(planned) == {"uav1": 0}
    assert time_table(planned, METRIC) is None
    scene = scene_answer(7, planned, IMPERIAL)
    assert (scene["n"], scene["lines"][0]["index"]) == (7, 0)
