"""The map's session: edits, undo, live paths, certificates, refusals with cures, the file, and unsaved edits."""

from __future__ import annotations

import queue
import random
import threading
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.errors import InputError
from gcsplan.page.answers import flown_line
from gcsplan.page.edits import Edits
from gcsplan.page.map_session import MapSession
from gcsplan.page.steps.flight_steps import PageSteps
from gcsplan.units import METRIC
from tests.page.desk import ANSWER_S, FLAT, Desk, desk_of

GOAL = "vehicles[0].goal"


@pytest.mark.slow
def test_a_page_gets_the_state_then_the_certificate_then_the_way_home(desk: Desk) -> None:
    state = desk.ask("hello", "state")
    assert (state["stage"], state["file"], state["saved"], state["undo"]) == ("mission", "field.yaml", True, False)
    assert state["vehicles"][0]["start"] == [46.5, 8.5]
    assert state["counts"] == {"no_fly": 2, "keep_in": 0}
    mast, pond = (zone["properties"] for zone in state["zones"]["features"])
    assert (mast["key"], mast["shape"], mast["center"], mast["radius_m"]) == ("no_fly[0]", "circle", [46.505, 8.5], 150)
    assert (pond["key"], pond["shape"], pond["editable"], len(pond["polygon"])) == ("no_fly[1]", "polygon", True, 3)
    assert next(f["value"] for f in state["form"] if f["key"] == "limits.min_agl_m") == 30
    found = desk.until("plan")
    assert found["verdict"] == "safe"
    assert {figure["key"] for figure in found["vehicles"][0]["figures"]} >= {"gap", "least_agl", "energy", "time"}
    profile = found["vehicles"][0]["profile"]
    assert len({len(values) for values in profile.values()}) == 1
    assert desk.until("home")["vehicles"][0]["way_home"]["safe"] is not None


@pytest.mark.slow
def test_the_certificate_is_that_of_the_command_line(desk: Desk, file: Path) -> None:
    found = desk.ask("hello", "plan")["vehicles"][0]
    [own] = plan(load_mission(file)).vehicles
    assert (found["length_m"], found["bound"], found["cost"]) == (
        own.verdict.length_m,
        own.solution.lower_bound,
        own.cost,
    )
    assert found["line"][:2] == [46.5, 8.5]


@pytest.mark.slow
def test_a_drag_gets_one_path_for_the_newest_place_and_no_step(desk: Desk) -> None:
    desk.ask("hello", "plan")
    for k in range(30):
        desk.send("change", changes={GOAL: [46.51, 8.51 + 1e-4 * k]}, live=True)
    path = desk.until("path")
    assert path["live"] is True
    assert path["line"][-3:-1] == pytest.approx([46.51, 8.5129], abs=1e-6)
    live = [a for a in desk.heard if a["type"] == "path" and a["live"]]
    assert len(live) < 30
    state = desk.ask("hello", "state")
    assert (state["undo"], state["vehicles"][0]["goal"]) == (False, [46.51, 8.51])


@pytest.mark.slow
def test_a_drop_is_one_step_that_undo_takes_back_and_redo_makes(desk: Desk) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "path", changes={GOAL: [46.512, 8.51]}, live=True)
    state = desk.ask("change", "state", changes={GOAL: [46.513, 8.51]})
    assert (state["undo"], state["saved"], state["vehicles"][0]["goal"]) == (True, False, [46.513, 8.51])
    assert desk.until("plan")["verdict"] == "safe"
    state = desk.ask("undo", "state")
    assert (state["undo"], state["redo"], state["saved"]) == (False, True, True)
    assert desk.ask("redo", "state")["vehicles"][0]["goal"] == [46.513, 8.51]


@pytest.mark.slow
def test_after_a_drop_the_path_of_the_drag_is_judged_before_the_search(desk: Desk, file: Path) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "path", changes={GOAL: [46.512, 8.51]}, live=True)
    first = desk.ask("change", "interim", changes={GOAL: [46.512, 8.51]})
    assert (first["verdict"], first["vehicles"][0]["verdict"], "plan" in first) == ("safe", "safe", False)
    heard = len(desk.heard)
    found = desk.until("plan")
    assert {a["type"] for a in desk.heard[heard:]} <= {"bound", "plan"}  # no path that is not judged replaces it
    mission = yaml.safe_load(file.read_text(encoding="utf-8"))
    mission["vehicles"][0]["goal"] = [46.512, 8.51]
    [own] = plan(mission).vehicles
    assert (found["vehicles"][0]["line"], found["vehicles"][0]["bound"]) == (
        flown_line(own.verdict),
        own.solution.lower_bound,
    )


@pytest.mark.slow
def test_tiles_of_the_terrain_before_are_there_for_a_page_that_still_requests_them(desk: Desk) -> None:
    place = 9, 268, 181
    revision = int(desk.ask("hello", "state")["terrain"]["tiles"].split("/")[1])
    for k in range(1, 3):
        assert desk.session.tile(revision, *place) is not None
        desk.ask("change", "state", changes={"terrain.flat_m": 100 + k})
    assert desk.session.tile(revision, *place) is None
    assert desk.session.tile(revision + 2, *place) is not None


@pytest.mark.slow
def test_a_drop_behind_a_drag_is_planned_without_the_path_of_the_drag(desk: Desk) -> None:
    desk.ask("hello", "home")
    heard: queue.Queue[dict[str, Any]] = queue.Queue()
    together = threading.Event()

    def hear(answer: dict[str, Any]) -> None:
        together.wait(ANSWER_S)  # the session takes what follows when all of it waits
        heard.put(answer)

    desk.session.attach(hear)
    desk.send("place", text="46.5, 8.5")
    desk.send("change", changes={GOAL: [46.52, 8.51]}, live=True)
    desk.send("change", changes={GOAL: [46.513, 8.51]})
    together.set()
    answers = [heard.get(timeout=ANSWER_S)]
    while answers[-1]["type"] != "plan":
        answers.append(heard.get(timeout=ANSWER_S))
    assert answers[-1]["n"] == desk.n
    assert not [a for a in answers if a["type"] == "path" and a["live"]]


@pytest.mark.slow
def test_a_page_that_comes_again_in_a_drag_gets_the_certificate_of_the_document(desk: Desk) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "path", changes={GOAL: [46.52, 8.51]}, live=True)
    found = desk.ask("hello", "plan")["vehicles"][0]
    assert found["profile"]["lat"][-1] == pytest.approx(46.51)


@pytest.mark.slow
def test_escape_forgets_the_drag(desk: Desk) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "path", changes={GOAL: [46.52, 8.51]}, live=True)
    assert desk.ask("cancel", "state")["vehicles"][0]["goal"] == [46.51, 8.51]
    assert desk.until("plan")["vehicles"][0]["profile"]["lat"][-1] == pytest.approx(46.51)


def test_a_plan_that_is_interrupted_by_a_question_is_made_all_the_same(desk: Desk) -> None:
    desk.send("hello")
    desk.send("place", text="46.5, 8.5")
    assert desk.until("place")["at"] == [46.5, 8.5]
    assert desk.until("plan")["verdict"] == "safe"
    assert desk.ask("place", "error", text="nowhere")["where"] == "place"


def test_a_goal_in_a_zone_is_refused_with_its_place(desk: Desk) -> None:
    desk.ask("hello", "plan")
    for live in (True, False):
        refused = desk.ask("change", "error", changes={GOAL: [46.505, 8.5]}, live=live)
        assert (refused["code"], refused["where"]) == ("bad_mission", GOAL)
        assert "mast" in refused["message"]


@pytest.mark.slow
def test_a_limit_that_leaves_no_path_is_refused_with_a_cure_that_does(desk: Desk) -> None:
    desk.ask("hello", "plan")
    refused = desk.ask("change", "refused", changes={"limits.max_amsl_m": 130})
    assert (refused["reason"], refused["vehicle"]) == ("infeasible", "uav1")
    assert refused["at"] == pytest.approx([46.5, 8.5], abs=1e-4)
    [cure] = refused["cures"]
    assert list(cure["changes"]) == ["limits.max_amsl_m"]
    assert desk.ask("change", "plan", changes=cure["changes"])["verdict"] == "safe"


@pytest.mark.slow
def test_a_wrong_number_stands_at_its_field(desk: Desk) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "error", changes={"limits.min_agl_m": -3})
    form = next(a for a in reversed(desk.heard) if a["type"] == "state")["form"]
    assert "must be at least 0" in next(f["error"] for f in form if f["key"] == "limits.min_agl_m")
    assert desk.ask("change", "state", changes={"limits.min_agl_m": 40})["problems"] == []
    assert "write max_agl_m 51 or more" in desk.ask("change", "error", changes={"limits.max_agl_m": 41})["message"]
    form = next(a for a in reversed(desk.heard) if a["type"] == "state")["form"]
    assert "write max_agl_m 51 or more" in next(f["error"] for f in form if f["key"] == "limits.max_agl_m")


@pytest.mark.slow
def test_a_save_keeps_the_comments_and_plans_the_same_by_the_command_line(desk: Desk, file: Path) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "state", changes={GOAL: [46.512, 8.512], "no_fly[2]": {"name": "tree", "center": [46.5, 8.52],
                                                                             "radius_m": 50}})  # fmt: skip
    desk.ask("change", "state", changes={"no_fly[0]": None, "vehicles[0].via": [[46.504, 8.506]]})
    assert desk.ask("save", "saved")["file"] == "field.yaml"
    assert desk.until("state")["saved"] is True
    text = file.read_text()
    for comment in ("# head", "# of all", "# the pond", "# the meadow"):
        assert comment in text
    assert "mast" not in text
    assert "tree" in text
    found = desk.ask("hello", "plan")["vehicles"][0]
    [own] = plan(load_mission(file)).vehicles
    assert (found["length_m"], found["bound"]) == (own.verdict.length_m, own.solution.lower_bound)


@pytest.mark.slow
def test_a_file_that_another_program_changed_is_not_overwritten(desk: Desk, file: Path) -> None:
    desk.ask("hello", "plan")
    desk.ask("change", "plan", changes={GOAL: [46.512, 8.512]})
    other = FLAT.replace("name: field", "name: meadow")
    file.write_text(other)
    assert desk.ask("save", "error")["code"] == "changed_on_disk"
    assert file.read_text() == other
    state = desk.ask("reload", "state")
    assert (state["name"], state["disk"], state["saved"], state["undo"]) == ("meadow", "same", True, True)
    assert desk.ask("undo", "state")["vehicles"][0]["goal"] == [46.512, 8.512]
    file.write_text(FLAT)
    desk.ask("save", "saved", over=True)
    assert "46.512" in file.read_text()


@pytest.mark.slow
def test_a_file_that_is_broken_meanwhile_is_words_and_the_edits_stay(desk: Desk, file: Path) -> None:
    desk.ask("hello", "plan")
    file.write_text("version: [")
    assert desk.ask("reload", "error")["code"] == "bad_mission"
    other = FLAT.replace("min_agl_m: 30", "min_agl_m: x")
    file.write_text(other)
    assert desk.ask("reload", "error")["code"] == "bad_mission"
    assert desk.ask("save", "error")["code"] == "changed_on_disk"
    assert file.read_text() == other
    assert desk.ask("hello", "state")["vehicles"][0]["goal"] == [46.51, 8.51]


@pytest.mark.slow
def test_a_change_on_the_disk_is_told_without_a_question(desk: Desk, file: Path) -> None:
    desk.ask("hello", "home")
    file.write_text(FLAT + "# more\n")
    assert desk.until("state")["disk"] == "changed"
    file.unlink()
    assert desk.until("state")["disk"] == "gone"


@pytest.mark.parametrize("name", ["../x.yaml", "/tmp/x.yaml", "x.txt", ".x.yaml", "a/b.yaml", "", "x\0.yaml", 7])
def test_a_save_never_leaves_the_folder(desk: Desk, name: object, file: Path) -> None:
    desk.ask("hello", "plan")
    assert desk.ask("save", "error", name=name)["code"] in ("not_saved", "bad_message")
    assert [p.name for p in file.parent.iterdir()] == ["field.yaml"]


@pytest.mark.slow
def test_edits_that_are_not_saved_are_found_again(file: Path) -> None:
    session = MapSession(Edits.of_file(file), METRIC, PageSteps)
    desk = Desk(session)
    desk.ask("hello", "plan")
    desk.ask("change", "plan", changes={GOAL: [46.515, 8.51]})
    kept = session.close()
    assert kept == file.with_name(".field.yaml.edits")
    assert file.read_text() == FLAT
    with desk_of(file, file.parent) as again:
        state = again.ask("hello", "state")
        assert (state["restored"], state["saved"], state["vehicles"][0]["goal"]) == (True, False, [46.515, 8.51])
        assert again.ask("undo", "state")["vehicles"][0]["goal"] == [46.51, 8.51]
        again.ask("redo", "state")
        again.ask("save", "saved")
        assert not kept.exists()
    file.write_text(FLAT)
    kept.write_text('{"of_sha256": "x", "mission": {"version": ')
    assert Edits.of_file(file).restored is False


@pytest.mark.slow
def test_steps_of_undo_survive_a_new_start_and_not_another_state_of_the_file(file: Path) -> None:
    goals = [[46.51, 8.51], [46.515, 8.51], [46.512, 8.51]]
    with desk_of(file, file.parent) as desk:
        for goal in goals[1:]:
            desk.ask("change", "plan", changes={GOAL: goal})
        desk.ask("save", "saved")
        desk.ask("undo", "plan")
    with desk_of(file, file.parent) as desk:
        state = desk.ask("hello", "state")
        assert (state["vehicles"][0]["goal"], state["undo"], state["redo"]) == (goals[1], True, True)
        assert desk.ask("redo", "state")["vehicles"][0]["goal"] == goals[2]
        desk.ask("undo", "state")
        assert desk.ask("undo", "state")["vehicles"][0]["goal"] == goals[0]
        assert desk.ask("redo", "state")["redo"]
        desk.ask("redo", "plan")  # as saved
    file.write_text(file.read_text().replace("field", "other"))
    with desk_of(file, file.parent) as desk:
        assert not desk.ask("hello", "state")["undo"]


@pytest.mark.slow
def test_edits_of_another_state_of_the_file_are_not_written_over_it(file: Path) -> None:
    session = MapSession(Edits.of_file(file), METRIC, PageSteps)
    desk = Desk(session)
    desk.ask("hello", "plan")
    desk.ask("change", "plan", changes={GOAL: [46.515, 8.51]})
    session.close()
    file.write_text(FLAT + "# of another program\n")
    with desk_of(file, file.parent) as again:
        assert again.ask("hello", "state")["disk"] == "changed"
        assert again.ask("save", "error")["code"] == "changed_on_disk"


def test_a_mission_from_nothing_leaves_the_kept_edits_of_a_file_alone(tmp_path: Path) -> None:
    (tmp_path / "mission.yaml").write_text(FLAT)
    with desk_of(tmp_path / "mission.yaml", tmp_path) as desk:
        desk.ask("change", "state", changes={GOAL: [46.515, 8.51]})
    kept = tmp_path / ".mission.yaml.edits"
    before = kept.read_bytes()
    with desk_of(None, tmp_path) as desk:
        assert desk.ask("hello", "state")["stage"] == "empty"
        ends = {"start": [46.5, 8.5], "goal": [46.51, 8.5]}
        desk.ask("new", "state", terrain={"flat_m": 400}, preset="copter", max_agl_m=120, **ends)
    assert kept.read_bytes() == before
    with desk_of(None, tmp_path) as desk:
        assert desk.ask("hello", "state")["restored"] is True


@pytest.mark.slow
def test_a_mission_begins_from_nothing_by_clicks_alone(tmp_path: Path) -> None:
    with desk_of(None, tmp_path) as desk:
        state = desk.ask("hello", "state")
        assert (state["stage"], state["terrain"], state["vehicles"]) == ("empty", None, [])
        assert "sample:jacksboro" in state["files"]
        state = desk.ask("new", "state", terrain={"flat_m": 400}, preset="copter", max_agl_m=120, min_agl_m=50)
        assert (state["stage"], state["terrain"]["flat"]) == ("draft", True)
        assert desk.ask("save", "error")["code"] == "not_saved"
        desk.ask("change", "state", changes={"vehicles[0].start": [46.5, 8.5]})
        assert desk.ask("change", "state", changes={GOAL: [46.51, 8.5]})["stage"] == "mission"
        found = desk.until("plan")["vehicles"][0]
        assert desk.ask("save", "saved", name="first.yaml")["file"] == "first.yaml"
        text = (tmp_path / "first.yaml").read_text()
        assert "gcsplan plan first.yaml" in text
        assert yaml.safe_load(text)["name"] == "first"
        [own] = plan(load_mission(tmp_path / "first.yaml")).vehicles
        assert (found["length_m"], found["bound"]) == (own.verdict.length_m, own.solution.lower_bound)
        assert desk.ask("save", "saved")["file"] == "first.yaml"
        (tmp_path / "there.yaml").write_text("mine")
        assert desk.ask("save", "error", name="there.yaml")["code"] == "exists"


@pytest.mark.parametrize(
    "terrain",
    [{}, {"dem": "/etc/passwd"}, {"dem": "../x.tif"}, {"dem": ["x.tif"]}, {"flat_m": "x"}, {"flat_m": True}, None,
     {"flat_m": 1, "dem": "sample:jacksboro"}, {"dem": "sample:jacksboro", "canopy": "/etc/passwd"}],
)  # fmt: skip
def test_ground_from_outside_the_folder_is_refused(tmp_path: Path, terrain: object) -> None:
    with desk_of(None, tmp_path) as desk:
        assert desk.ask("new", "error", terrain=terrain, preset="copter")["code"] in ("bad_message", "bad_change")
        assert desk.ask("hello", "state")["stage"] == "empty"


@pytest.mark.slow
def test_a_via_keeps_its_height_where_it_moves_and_its_form_where_it_stays(file: Path) -> None:
    file.write_text(FLAT + '    via: ["46.503 N, 8.503 E", {at: "46.506, 8.507", agl_m: 80}]\n')
    with desk_of(file, file.parent) as desk:
        via = desk.ask("hello", "state")["vehicles"][0]["via"]
        assert via == [[46.503, 8.503], [46.506, 8.507]]
        desk.ask("change", "plan", changes={"vehicles[0].via": [via[0], [46.507, 8.508]]})
        desk.ask("save", "saved")
    written = yaml.safe_load(file.read_text())["vehicles"][0]["via"]
    assert written == ["46.503 N, 8.503 E", {"lat": 46.507, "lon": 8.508, "agl_m": 80}]


@pytest.mark.slow
def test_a_limit_in_feet_is_changed_in_feet(file: Path) -> None:
    file.write_text(FLAT.replace("min_agl_m: 30", "min_agl_ft: 100"))
    with desk_of(file, file.parent) as desk:
        field = next(f for f in desk.ask("hello", "state")["form"] if f["key"].startswith("limits.min_agl"))
        assert (field["key"], field["unit"], field["value"], field["quantity"]) == (
            "limits.min_agl_ft",
            "ft",
            100,
            None,
        )
        desk.ask("change", "plan", changes={"limits.min_agl_ft": 120})
        desk.ask("save", "saved")
    assert "min_agl_ft: 120" in file.read_text()


@pytest.mark.slow
def test_units_change_the_words_and_not_the_numbers(desk: Desk) -> None:
    metric = desk.ask("hello", "plan")["vehicles"][0]
    feet = desk.ask("units", "plan", units="aviation")["vehicles"][0]
    assert feet["length_m"] == metric["length_m"]
    assert " ft" in next(f["text"] for f in feet["figures"] if f["key"] == "least_agl")
    for no_name in ("cubits", ["metric"], {"metric": 1}, None):
        assert desk.ask("units", "error", units=no_name)["code"] == "bad_message"
        assert desk.ask("new", "error", terrain={"flat_m": 1}, preset=no_name)["code"] == "bad_message"


def test_a_broken_mission_file_is_an_error_of_the_command(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("version: [")
    with pytest.raises(InputError):
        Edits.of_file(tmp_path / "bad.yaml")


STRANGE: tuple[Any, ...] = (
    None, True, -1, 0.5, 1e300, 10**30, "", "x", "46.5, 8.5", "\x00", [], [46.5, 8.5], [[46.5, 8.5]], ["a", "b"], {},
    {"a": 1}, {"flat_m": 100}, {"center": [46.505, 8.503], "radius_m": 30}, {"vehicles[0].start": [46.5, 8.501]},
    {"no_fly[0]": {"radius_m": "x"}, "vehicles[9]": None}, {"limits.min_agl_m": {}, "wind.speed_m_s": []},
)  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(10))
def test_no_message_of_a_hostile_page_is_a_bug(file: Path, seed: int) -> None:
    rng = random.Random(seed)
    needs = {"change": "changes", "new": "preset", "set_text": "text", "save": "name", "look": "to", "write": "fence",
             "inspect": "settings", "take": "settings", "scene": "on"}  # fmt: skip
    kinds = (
        *needs,
        "units",
        "vehicle",
        "section",
        "arrange",
        "undo",
        "redo",
        "reload",
        "cancel",
        "hello",
        "upload",
        "stop",
    )
    fields = ("terrain", "live", "yaml", "plan", "ticket", "as", "over", "start", "goal", "max_agl_m", "vehicle")
    with desk_of(file, file.parent) as desk:
        desk.ask("hello", "plan")
        for _ in range(80):
            kind = rng.choice(kinds)
            more = {rng.choice(fields): rng.choice(STRANGE) for _ in range(rng.randint(0, 2))}
            desk.send(kind, **more | {needs.get(kind, kind): rng.choice(STRANGE)})
            desk.ask("place", "place", text="46.5, 8.5")
    assert [a for a in desk.heard if a.get("code") == "internal"] == []


@pytest.mark.slow
def test_lists_gain_lose_and_reorder_entries_with_comments_and_undo(desk: Desk) -> None:
    desk.ask("hello", "plan")
    before = desk.ask("text", "text")["text"]
    desk.ask("arrange", "plan", list="no_fly", **{"from": 1, "to": 0})
    moved = desk.ask("text", "text")["text"]
    assert sorted(moved.splitlines()) == sorted(before.splitlines())
    assert moved.index("# the pond") < moved.index("# the mast")
    typed = {"vehicles[0].via": "[[46.504, 8.507], [46.506, 8.508]]"}
    desk.ask("change", "plan", changes={}, yaml=typed)
    desk.ask("change", "plan", changes={}, yaml={"vehicles[0].via": "[[46.506, 8.508], [46.504, 8.507]]"})
    fields = {f["key"]: f for f in desk.ask("section", "section", section="vehicles[0]")["fields"]}
    assert fields["vehicles[0].via"]["list"]["entries"][0] == "[46.506, 8.508]"
    desk.ask("change", "plan", changes={"keep_in[0]": {"name": "all", "center": [46.505, 8.505], "radius_m": 5000}})
    desk.ask("change", "plan", changes={"keep_in[0]": None})
    for _ in range(5):
        desk.ask("undo", "plan")
    assert desk.ask("text", "text")["text"] == before
