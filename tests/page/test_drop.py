"""A dropped file: judged as `gcsplan check` judges it, read as the mission would read it, taken only by the user."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil

from gcsplan.app.check.files import check_batch, finding_lines
from gcsplan.app.fleet.pipeline import load_mission
from tests.page.desk import FLAT, Desk, desk_of

ROWS = [(16, 46.5, 8.5, 100), (22, 46.5, 8.5, 40), (16, 46.505, 8.52, 40), (16, 46.51, 8.51, 20), (21, 46.51, 8.51, 0)]
WAYPOINTS = "QGC WPL 110\n" + "".join(
    f"{k}\t{int(k == 0)}\t{3 * int(k > 0)}\t{command}\t0\t0\t0\t0\t{lat}\t{lon}\t{z}\t1\n"
    for k, (command, lat, lon, z) in enumerate(ROWS)
)
ZONES: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "properties": {"name": "wood"}, "geometry": {
            "type": "Polygon", "coordinates": [[[8.52, 46.5], [8.53, 46.5], [8.53, 46.51], [8.52, 46.5]]]}},
        {"type": "Feature", "properties": {"name": "wire"}, "geometry": {
            "type": "LineString", "coordinates": [[8.54, 46.5], [8.55, 46.5]]}},
    ],
}  # fmt: skip


def drop(desk: Desk, name: str, data: bytes, **more: Any) -> dict[str, Any]:
    """What the page is told of a file."""
    coming = desk.session.shelf.receive(name, len(data))
    coming.add(data)
    desk.session.shelf.put(coming)
    return desk.ask("inspect", "dropped", **more)


def drop_all(desk: Desk, files: dict[str, bytes], **more: Any) -> dict[str, Any]:
    """What the page is told of files that are dropped together."""
    for k, (name, data) in enumerate(files.items()):
        coming = desk.session.shelf.receive(name, len(data), more=k > 0)
        coming.add(data)
        desk.session.shelf.put(coming)
    return desk.ask("inspect", "dropped", **more)


def raster(driver: str, west: float = 8.48, north: float = 46.53, *, cells: int = 40, step: float = 0.001) -> bytes:
    """A raster over the field, in a format of GDAL."""
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", width=cells, height=cells, count=1, dtype="int16", crs="EPSG:4326",
                         transform=rasterio.Affine(step, 0.0, west, 0.0, -step, north)) as made:  # fmt: skip
            made.write(np.full((1, cells, cells), 120, np.int16))
        if driver == "GTiff":
            return memory.read()
        with memory.open() as source, rasterio.MemoryFile() as target:
            rasterio.shutil.copy(source, target.name, driver=driver)
            return target.read()


def refusal(desk: Desk, kind: str, **more: Any) -> dict[str, Any]:
    """The error that answers a message."""
    desk.send(kind, **more)
    with pytest.raises(AssertionError):
        desk.until("plan")
    return desk.heard[-1]


@pytest.mark.slow
def test_a_dropped_mission_has_the_findings_of_the_command_line(desk: Desk, file: Path) -> None:
    found = drop(desk, "a b.waypoints", WAYPOINTS.encode())
    own = file.parent / "a_b.waypoints"
    assert not own.exists()  # nothing is written
    own.write_text(WAYPOINTS)
    [checked] = check_batch(load_mission(file), [str(own)]).checked
    lines = [f"{own}:{f['item']}: {f['kind']}: {f['text']}" for f in found["findings"]]
    assert lines == finding_lines(checked)[: len(lines)]
    assert (found["verdict"], found["findings_count"], found["passes"]) == ("violations", len(lines), False)
    low = next(f for f in found["findings"] if f["kind"] == "min_agl")
    assert (low["item"], low["at"]) == (3, pytest.approx([46.51, 8.51], abs=1e-6))
    assert low["distance_m"] == pytest.approx(found["profile"]["distance_m"][-1], abs=30.0)
    assert found["items"][0] == {"item": 0, "name": "home", "at": [46.5, 8.5]}


def test_a_file_that_cannot_be_read_is_answered_in_the_command_lines_words(desk: Desk) -> None:
    found = drop(desk, "bad.waypoints", WAYPOINTS.replace("\t46.505", "\tx").encode())
    assert "bad.waypoints" in found["error"]
    assert "bad.waypoints:4: " in found["error"]
    assert "verdict" not in found
    assert drop(desk, "bad.plan", b"{" * 10_000)["error"]
    assert drop(desk, "bad.kml", b"\0" * 100)["error"]
    assert drop(desk, "bad.tif", b"II*\0" + b"\xff" * 100)["error"]
    assert drop(desk, "vrt.tif", b"<VRTDataset>/etc/passwd</VRTDataset>")["error"]
    desk.session.shelf.clear()
    assert refusal(desk, "inspect")["code"] == "bad_file"


@pytest.mark.slow
def test_a_route_planned_anew_is_one_step_that_undo_takes_back(desk: Desk) -> None:
    found = drop(desk, "a.waypoints", WAYPOINTS.encode())
    assert (found["route"]["via"], found["route"]["left_out"]) == (1, [])
    state = desk.ask("take", "state", through=True)
    assert state["vehicles"][0]["via"] == [[46.505, 8.52]]
    assert desk.ask("undo", "state")["vehicles"][0]["via"] == []
    drop(desk, "a.waypoints", WAYPOINTS.encode())
    assert desk.ask("take", "state", through=False)["vehicles"][0]["via"] == []


def test_a_draft_gets_start_and_goal_from_a_dropped_mission(tmp_path: Path) -> None:
    with desk_of(None, tmp_path) as desk:
        assert drop(desk, "a.waypoints", WAYPOINTS.encode())["error"]  # there is no ground to check it over
        assert refusal(desk, "take")["code"] in ("bad_change", "bad_file")
        desk.ask("new", "state", terrain={"flat_m": 100}, preset="copter", max_agl_m=120, start=None, goal=None)
        drop(desk, "a.waypoints", WAYPOINTS.encode())
        state = desk.ask("take", "state")
        assert (state["stage"], state["vehicles"][0]["start"]) == ("mission", [46.5, 8.5])


@pytest.mark.slow
def test_zones_are_added_as_they_were_understood_and_shown(desk: Desk, file: Path) -> None:
    data = json.dumps(ZONES).encode()
    assert "half-width" in drop(desk, "z.geojson", data)["error"]
    assert refusal(desk, "take")["code"] == "bad_file"
    assert not (file.parent / "z.geojson").exists()
    found = desk.ask("inspect", "dropped", settings={"ignore": ["lines"]})
    assert (found["count"], found["there"]) == (1, False)
    assert any("wire" in note for note in found["notes"])  # what is left out has its name
    (file.parent / "z.geojson").write_text("mine")
    error = refusal(desk, "take", settings={"ignore": ["lines"]})
    assert (error["code"], (file.parent / "z.geojson").read_text()) == ("file_exists", "mine")
    state = desk.ask("take", "state", settings={"ignore": ["lines"]}, over=True)
    assert [z["properties"]["name"] for z in state["zones"]["features"]] == ["mast", "pond", "wood"]
    assert (file.parent / "z.geojson").read_bytes() == data
    assert "{file: z.geojson, ignore: [lines]}" in desk.ask("text", "text")["text"]
    pond = json.dumps({**ZONES["features"][0], "properties": {"name": "pond 2"}}).encode()
    assert drop(desk, "z.geojson", pond)["there"] is True
    state = desk.ask("take", "state", over=True)  # the entry that names the older file has the new zones, too
    assert [z["properties"]["name"] for z in state["zones"]["features"]] == ["mast", "pond", "pond 2", "pond 2"]
    drop(desk, "area.geojson", json.dumps(ZONES["features"][0]).encode(), **{"as": "keep_in"})
    desk.ask("take", "state", **{"as": "keep_in"})
    assert "keep_in:\n  - {file: area.geojson}" in desk.ask("text", "text")["text"]


@pytest.mark.parametrize("settings", [{"file": "/etc/passwd"}, {"radius_m": "x"}, {"ignore": ["all"]}, {"on_bad": 3}])
def test_settings_name_no_file_and_wrong_ones_are_said(desk: Desk, settings: dict[str, Any]) -> None:
    found = drop(desk, "z.geojson", json.dumps(ZONES["features"][0]).encode(), settings=settings)
    assert bool(found["error"]) != ("file" in settings)
    assert "passwd" not in json.dumps(found)


@pytest.mark.slow
def test_a_raster_becomes_the_ground_with_the_datum_that_it_needs(desk: Desk, file: Path) -> None:
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", width=40, height=40, count=1, dtype="float32", crs="EPSG:4326",
                         transform=rasterio.Affine(0.001, 0.0, 8.48, 0.0, -0.001, 46.53)) as made:  # fmt: skip
            made.write(np.full((1, 40, 40), 120.0, np.float32))
        data = memory.read()
    assert "vertical_datum" in drop(desk, "dem.tif", data)["error"]
    found = desk.ask("inspect", "dropped", settings={"vertical_datum": "EGM96"})
    assert (found["error"], found["cells"], found["places"], found["beside"]) == ("", [[40, 40]], 2, 0)
    assert found["bounds"] == pytest.approx([8.48, 46.49, 8.52, 46.53], abs=1e-3)
    state = desk.ask("take", "state", settings={"vertical_datum": "EGM96"})
    assert "dem.tif" in state["files"]
    assert "terrain: {dem: dem.tif, vertical_datum: EGM96}" in desk.ask("text", "text")["text"].replace('"', "")
    assert (file.parent / "dem.tif").read_bytes() == data


def test_a_text_with_a_mistake_is_refused_at_its_line_and_the_mission_stays(desk: Desk, file: Path) -> None:
    before = desk.ask("hello", "state")
    text = desk.ask("text", "text")["text"]
    assert text == FLAT
    for bad, line in (
        (text.replace("30}", "x}"), 5),
        (text.replace("mast, ", "mast: ,"), 7),
        (text + "version: 1\n", 15),
    ):
        error = refusal(desk, "set_text", text=bad)
        assert (error["code"], error["problems"][0]["line"]) == ("bad_text", line)
    assert refusal(desk, "set_text", text="terrain: {dem: /etc/passwd}")["code"] == "bad_text"
    assert refusal(desk, "set_text", text=3)["code"] == "bad_message"
    after = desk.ask("hello", "state")
    assert (after["vehicles"], after["saved"], after["undo"]) == (before["vehicles"], True, False)


@pytest.mark.slow
def test_a_text_is_one_step_with_its_comments_and_lasts_without_a_save(desk: Desk, file: Path) -> None:
    text = FLAT.replace("# of all", "# by hand").replace("30}", "35}")
    assert desk.ask("set_text", "state", text=text)["saved"] is False
    desk.ask("change", "state", changes={"vehicles[0].goal": [46.511, 8.51]})
    assert "# by hand" in desk.ask("text", "text")["text"]
    desk.session.close()
    with desk_of(file, file.parent) as again:
        state = again.ask("hello", "state")
        assert (state["restored"], state["vehicles"][0]["goal"]) == (True, [46.511, 8.51])
        assert "# by hand" in again.ask("text", "text")["text"]
        state = again.ask("undo", "state")
        assert (state["saved"], again.ask("text", "text")["text"]) == (False, text)
        state = again.ask("undo", "state")
        assert (state["saved"], again.ask("text", "text")["text"]) == (True, FLAT)
        again.ask("redo", "state")
        again.ask("redo", "state")
        again.ask("save", "saved")
    assert "35}   # by hand" in file.read_text()


def test_a_field_that_is_typed_as_in_the_file_changes_its_key_alone(desk: Desk) -> None:
    desk.ask("change", "state", changes={}, yaml={"vehicles[0].speed_m_s": "[3, 12]"})
    assert "speed_m_s: [3, 12]" in desk.ask("text", "text")["text"]
    fields = desk.ask("section", "section", section="vehicles[0]")["fields"]
    assert next(f["value"] for f in fields if f["key"] == "vehicles[0].speed_m_s") == "[3, 12]"
    error = refusal(desk, "change", changes={}, yaml={"vehicles[0].speed_m_s": "[3, "})
    assert (error["code"], error["where"]) == ("bad_change", "vehicles[0].speed_m_s")


@pytest.mark.slow
def test_a_required_return_counts_in_the_verdict_on_a_file(desk: Desk) -> None:
    flown = WAYPOINTS.replace("\t20\t1\n", "\t40\t1\n").encode()  # the return, at 15 m, is below the lowest height
    found = drop(desk, "a.waypoints", flown)
    assert (found["verdict"], found["passes"], found["return_safe"]) == ("safe", True, False)
    desk.ask("change", "state", changes={"way_home": "required"})
    found = desk.ask("inspect", "dropped")
    assert (found["verdict"], found["passes"], found["return_safe"]) == ("violations", False, False)


DATUM = {"settings": {"vertical_datum": "EGM96"}}


@pytest.mark.slow
def test_ground_of_every_format_is_read_as_the_mission_reads_it_and_taken_whole(desk: Desk, file: Path) -> None:
    asc = raster("AAIGrid")
    assert "crs" in drop(desk, "a.asc", asc, **DATUM)["error"]
    prj = rasterio.crs.CRS.from_epsg(4326).to_wkt().encode()
    found = drop_all(desk, {"a.asc": asc, "a.prj": prj}, **DATUM)
    assert (found["error"], found["cells"], found["files"], found["beside"]) == ("", [[40, 40]], ["a.asc", "a.prj"], 0)
    desk.ask("take", "state", **DATUM)
    assert ((file.parent / "a.asc").read_bytes(), (file.parent / "a.prj").read_bytes()) == (asc, prj)
    for name, data in (
        ("N46E008.hgt", np.full(1201**2, 120, ">i2").tobytes()),
        ("a.img", raster("HFA")),
        ("a.xyz", raster("XYZ")),
        ("n46.dt1", raster("DTED", 8.0 - 0.5 / 1200, 47.0 + 0.5 / 1200, cells=1201, step=1 / 1200)),
    ):
        found = drop(desk, name, data, settings={"vertical_datum": "EGM96", "crs": "EPSG:4326"})
        assert (found["error"], found["beside"]) == ("", 0), name
    tiles = {"west.tif": raster("GTiff", 8.46), "east.tif": raster("GTiff", 8.50)}
    found = drop_all(desk, tiles, **DATUM)
    assert (found["error"], len(found["cells"]), found["bounds"][0], found["beside"]) == (
        "",
        2,
        pytest.approx(8.46, abs=1e-3),
        0,
    )
    desk.ask("take", "state", **DATUM)
    assert "dem: [west.tif, east.tif]" in desk.ask("text", "text")["text"]


VRT = """<VRTDataset rasterXSize="40" rasterYSize="40"><SRS>EPSG:4326</SRS>
<GeoTransform>8.48, 0.001, 0, 46.53, 0, -0.001</GeoTransform><VRTRasterBand dataType="Int16" band="1"><SimpleSource>
<SourceFilename relativeToVRT="RELATIVE">NAME</SourceFilename><SourceBand>1</SourceBand>
<SrcRect xOff="0" yOff="0" xSize="40" ySize="40"/><DstRect xOff="0" yOff="0" xSize="40" ySize="40"/></SimpleSource>
</VRTRasterBand></VRTDataset>"""


@pytest.mark.slow
def test_a_vrt_puts_together_what_was_dropped_with_it_and_nothing_else(desk: Desk, file: Path) -> None:
    tile = raster("GTiff")
    (file.parent / "other.tif").write_bytes(tile)
    whole = VRT.replace("RELATIVE", "1").replace("NAME", "tile.tif").encode()
    assert drop_all(desk, {"all.vrt": whole, "tile.tif": tile}, **DATUM)["error"] == ""
    assert "not there" in drop(desk, "all.vrt", whole, **DATUM)["error"]
    for name in (str(file.parent / "other.tif"), "/vsicurl/http://127.0.0.1:1/x.tif", "/etc/passwd"):
        found = drop(desk, "all.vrt", VRT.replace("RELATIVE", "0").replace("NAME", name).encode(), **DATUM)
        assert found["error"], name
        assert "gcsplan-" not in found["error"]  # no folder of this machine
    for bad in ("a.prj", "a.asc", "N46E008.hgt", "a.dt2", "a.img", "a.nc", "a.xyz", "N46E008.DAT", "a.vrt"):
        found = drop(desk, bad, b"not a raster" * 50, **DATUM)
        assert len(found["error"]) > 20, bad
        assert "gcsplan-" not in found["error"], found["error"]
        assert refusal(desk, "take", **DATUM)["code"] == "bad_file"
        assert not (file.parent / bad).exists()
