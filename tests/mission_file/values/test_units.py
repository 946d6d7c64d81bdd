"""Keys in other units: the same mission as in the file's own, one note, and mistakes at the key that was written."""

import math
from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.values import schema
from gcsplan.mission_file.values.units import (
    MOST_CONVERSIONS,
    OTHERS,
    UNIT_SYMBOLS,
    in_own_units,
    other_names,
    unit_end,
)
from gcsplan.notes.note import Note

SIZES = {
    "_ft": lambda v: v * 12 * 0.0254,
    "_nm": lambda v: v * 1852,
    "_kt": lambda v: v * 1852 / 3600,
    "_kmh": lambda v: v * 1000 / 3600,
    "_min": lambda v: v * 60,
    "_wh": lambda v: v * 3600,
    "_mah": lambda v: v / 1000 * 3600 * 22.2,
}
"""The conversions once more, written from the units' definitions."""


def kinds() -> list[type[schema.Keys]]:
    found = [schema.Keys]
    for kind in found:
        found += kind.__subclasses__()
    return [kind for kind in found if kind.model_fields]


def mission(limits: dict | None = None, energy: dict | None = None, **keys: object) -> dict:
    """A flat mission; ``keys`` are those of its vehicle."""
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": {"east_m": 0, "north_m": 0},
        "goal": {"east_m": 926, "north_m": 0}, "energy": energy or {}, **keys,
    }  # fmt: skip
    return {
        "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "limits": limits or {"min_agl_m": 30}, "vehicles": [vehicle],
    }  # fmt: skip


def problems(content: dict) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        load_mission(content)
    return {p.where: p.message for p in caught.value.problems}


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.__name__)
def test_every_key_with_a_convertible_unit_has_other_names_that_are_no_keys(kind: type[schema.Keys]):
    names = other_names(kind.model_fields)
    assert not names.keys() & kind.model_fields.keys()
    for key in kind.model_fields:
        others = [name for name, written in names.items() if written.key == key]
        for own, ends in (
            ("_m_s", ("_kt", "_kmh")),
            ("_m", ("_ft", "_nm")),
            ("_s", ("_min",)),
            ("_j", ("_wh", "_mah")),
        ):
            if key.endswith(own):
                wanted = [] if key.endswith("_j_per_m") else [key.removesuffix(own) + end for end in ends]
                assert others == wanted
                break
        else:
            assert others == []


@pytest.mark.parametrize(
    ("section", "stem", "own", "end"),
    [
        ("limits", "min_agl", "_m", "_ft"),
        ("limits", "track_error", "_m", "_nm"),
        ("vehicle", "climb", "_m_s", "_kt"),
        ("vehicle", "descent", "_m_s", "_kmh"),
        ("arrival", "interval", "_s", "_min"),
        ("planner", "budget", "_s", "_min"),
        ("energy", "battery", "_j", "_wh"),
        ("energy", "battery", "_j", "_mah"),
    ],
)
def test_a_value_is_converted_as_its_unit_is_defined(section: str, stem: str, own: str, end: str):
    volts = {"battery_v": 22.2} if end == "_mah" else {}  # the model keeps it, to show energies in mAh
    raw = {stem + end: 7.5} | volts
    wrapped = {"vehicle": {"vehicles": [raw]}, "energy": {"vehicles": [{"energy": raw}]}}.get(section, {section: raw})
    converted = in_own_units(wrapped, "").raw
    found = converted[section] if section in converted else converted["vehicles"][0]
    found = found["energy"] if section == "energy" else found
    assert found == {stem + own: pytest.approx(SIZES[end](7.5), rel=1e-12)} | volts


def test_every_unit_is_held_against_its_definition():
    assert {end for ends in OTHERS.values() for end in ends} == SIZES.keys()


def test_a_mission_in_other_units_is_the_mission_in_its_own():
    other = mission({"min_agl_ft": 100, "max_amsl_ft": 1000, "track_error_m": 2}, {"battery_wh": 100},
                    speed_kt=[6, 24], climb_kmh=9, takeoff_agl_ft=120, start={"east_ft": 0, "north_nm": 0},
                    goal={"east_nm": 0.5, "north_ft": 0})  # fmt: skip
    other["arrival"] = {"mode": "sequence", "interval_min": 1.5}
    knot = 1852 / 3600
    own = mission({"min_agl_m": 30.48, "max_amsl_m": 304.8, "track_error_m": 2}, {"battery_j": 360_000.0},
                  speed_m_s=[6 * knot, 24 * knot], climb_m_s=9 / 3.6, takeoff_agl_m=36.576)  # fmt: skip
    own["arrival"] = {"mode": "sequence", "interval_s": 90}
    a, b = load_mission(other), load_mission(own)
    assert repr(a.vehicles) == repr(b.vehicles)
    assert a.arrival == b.arrival


def test_one_note_says_each_value_in_the_keys_own_unit():
    loaded = load_mission(mission({"min_agl_ft": 164}, {"battery_mah": 5000, "battery_v": 22.2}, speed_kt=[6, 29]))
    assert loaded.vehicles[0].vehicle.energy.battery_j == pytest.approx(399_600)
    assert tuple(map(str, loaded.notes[:3])) == (
        "limits.min_agl_ft: 164 ft, read as min_agl_m: 49.9872",
        "vehicles[0].energy.battery_mah: 5000 mAh at 22.2 V, read as battery_j: 399600",
        "vehicles[0].speed_kt: [6, 29] kt, read as speed_m_s: [3.086666667, 14.91888889]",
    )


@pytest.mark.slow
def test_notes_on_a_fleet_are_few():
    content = mission()
    first = content["vehicles"][0]
    content["vehicles"] = [
        {**first, "name": f"uav{i}", "sysid": i, "min_agl_ft": 164, "track_error_ft": i / 10} for i in range(1, 101)
    ]
    wanted = ("value_converted", "and_as_many_more", "more_values_converted")
    notes = [note for note in load_mission(content).notes if note.code in wanted]
    assert str(notes[0]) == "vehicles[0].min_agl_ft: 164 ft, read as min_agl_m: 49.9872 (and 99 more)"
    assert len(notes) == MOST_CONVERSIONS + 1
    assert notes[-1] == Note("more_values_converted", count=81)


def test_wider_terrain_keeps_units_and_notes():
    loaded = load_mission(mission({"min_agl_ft": 164}))
    again = loaded.reaching([(36.6, -84.3)])
    assert again.notes == loaded.notes
    assert again.vehicles[0].vehicle.limits.min_agl_m == pytest.approx(49.9872)


@pytest.mark.parametrize(
    ("limits", "key", "also"),
    [
        ({"min_agl_m": 50, "min_agl_ft": 164}, "min_agl_ft", "min_agl_m"),
        ({"min_agl_ft": 164, "min_agl_m": 50}, "min_agl_ft", "min_agl_m"),
        ({"min_agl_ft": 164, "min_agl_nm": 0.02}, "min_agl_nm", "min_agl_ft"),
    ],
)
def test_a_key_in_two_units_is_an_error(limits: dict, key: str, also: str):
    found = problems(mission(limits))
    assert found[f"mission: limits.{key}"] == f"stands as {also} too; keep one"
    assert "mission: vehicles[0].min_agl_m" not in found


@pytest.mark.parametrize(
    ("limits", "place", "words"),
    [
        (
            {"min_agl_ft": -164},
            "min_agl_ft",
            "must be at least 0, given -49.9872 (-164 ft, read as min_agl_m: -49.9872)",
        ),
        (
            {"min_agl_ft": "164"},
            "min_agl_ft",
            "given the text '164'; write the number alone, without quotes: 164 (read as min_agl_m)",
        ),
        ({"min_agl_ft": True}, "min_agl_ft", "must be a number, given true (read as min_agl_m)"),
        ({"min_agl_ft": 10**400}, "min_agl_ft", "(read as min_agl_m)"),
        ({"min_agl_ft": math.nan}, "min_agl_ft", "must be a finite number"),
        ({"min_agl_ft": math.inf}, "min_agl_ft", "must be a finite number"),
        ({"min_agl_ft": [164]}, "min_agl_ft", "must be a number"),
    ],
)
def test_a_wrong_value_is_reported_at_the_key_that_was_written(limits: dict, place: str, words: str):
    assert words in problems(mission(limits))[f"mission: limits.{place}"]


def test_one_of_two_speeds_is_reported_at_its_place():
    found = problems(mission(speed_kt=[6, 29_000]))
    assert found["mission: vehicles[0].speed_kt[1]"].startswith("must be at most 300, given 14918.8")


@pytest.mark.parametrize(
    ("energy", "place", "words"),
    [
        ({"battery_mah": 5000}, "battery_mah", "needs battery_v, the nominal voltage: a number above 0"),
        ({"battery_mah": 5000, "battery_v": 0}, "battery_mah", "given 0"),
        ({"battery_mah": 5000, "battery_v": "6S"}, "battery_mah", "given the text '6S'"),
        (
            {"battery_v": 22.2},
            "battery_v",
            "counts with the battery's capacity only: give one of battery_j, battery_wh",
        ),
        ({"battery_wh": 90, "battery_v": 0}, "battery_v", "0"),
        ({"battery_wh": 90, "battery_j": 324_000}, "battery_wh", "stands as battery_j too"),
        ({"horizontal_j_per_ft": 30}, "horizontal_j_per_ft", "did you mean horizontal_j_per_m (in J/m)?"),
        ({"hover_kw": 0.4}, "hover_kw", "did you mean hover_w (in W)?"),
    ],
)
def test_charges_and_units_that_are_not_understood(energy: dict, place: str, words: str):
    assert words in problems(mission(energy=energy))[f"mission: vehicles[0].energy.{place}"]


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (
            {"min_agl_m": 50, "track_error_yd": 4},
            "did you mean track_error_m (in m), track_error_ft or track_error_nm?",
        ),
        ({"min_agll_ft": 164}, "did you mean min_agl_ft?"),
        ({"min_agll_m": 50}, "did you mean min_agl_m?"),
    ],
)
def test_a_suggestion_in_another_unit_says_so(limits: dict, words: str):
    assert any(words in message for message in problems(mission(limits)).values())


def test_climb_in_metres_a_minute_is_not_taken_for_minutes():
    assert "did you mean climb_m_s (in m/s), climb_kt or climb_kmh?" in next(
        iter(problems(mission(climb_m_min=150)).values())
    )


def test_a_longer_unit_counts_before_its_end():
    ends = list(UNIT_SYMBOLS)
    assert not any(longer.endswith(end) for i, end in enumerate(ends) for longer in ends[i + 1 :])
    assert [unit_end(key) for key in ("climb_m_s", "horizontal_j_per_m", "accel_m_s2")] == ["_m_s", "_j_per_m", "_m_s2"]


def test_a_file_in_feet_is_read(tmp_path: Path):
    file = tmp_path / "feet.yaml"
    file.write_text(
        "version: 1\nterrain: {flat_ft: 1000}\nframe: {origin: [36.6, -84.3], amsl_m: 0}\nlimits: {min_agl_ft: 164}\n"
        "no_fly: [{center: {east_ft: 1500, north_m: 0}, radius_nm: 0.05, ceiling_agl_ft: 400}]\nvehicles:\n"
        "- {name: uav1, sysid: 1, autopilot: px4, start: {east_m: 0, north_m: 0}, goal: {east_nm: 0.5, north_m: 0}}\n"
    )
    loaded = load_mission(file)
    assert loaded.surface.ground_at(0.0, 0.0) == pytest.approx(304.8)
    zone = loaded.zones[0]
    assert (zone.shape.east_m, zone.shape.radius_m) == (pytest.approx(457.2), pytest.approx(92.6))
    assert zone.ceiling is not None
    assert zone.ceiling.value_m == pytest.approx(121.92)
