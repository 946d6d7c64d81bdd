"""Files on the page of `gcsplan map` in a real browser: dropped, understood, mended, taken; all keys, and the text."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from gcsplan.app.fleet.pipeline import load_mission, plan
from tests.page.browser_hand import IN_A_BROWSER, Hand
from tests.page.steps.test_walk import sent
from tests.page.talk import FLAT, eventually, serving
from tests.support.browser import Browser

pytestmark = [pytest.mark.slow, pytest.mark.nightly, *IN_A_BROWSER]
HILLS = """\
version: 1
terrain: {dem: sample:jacksboro, vertical_datum: EGM96}
limits: {min_agl_m: 60}   # of all
no_fly:
  - {name: quarry, center: [36.6167, -84.3446], radius_m: 300}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.62, -84.38], goal: [36.62, -84.36]}
"""
FLOWN = [(36.6175, -84.3892), (36.6167, -84.3446), (36.6158, -84.3000)]


def plan_file() -> str:
    """A mission of QGroundControl at 120 m above home: through a zone, and through a hill."""
    rows = [(22, *FLOWN[0], 120.0), *((16, *place, 120.0) for place in FLOWN[1:]), (21, *FLOWN[-1], 0.0)]
    items = [
        {"type": "SimpleItem", "command": command, "frame": 3, "autoContinue": True, "doJumpId": k + 1,
         "params": [0, 0, 0, None, lat, lon, height_m]} for k, (command, lat, lon, height_m) in enumerate(rows)
    ]  # fmt: skip
    mission = {"version": 2, "firmwareType": 3, "vehicleType": 2, "cruiseSpeed": 10, "hoverSpeed": 5, "items": items,
               "plannedHomePosition": [*FLOWN[0], 400.0]}  # fmt: skip
    empty = {"geoFence": {"version": 2, "circles": [], "polygons": []}, "rallyPoints": {"version": 2, "points": []}}
    return json.dumps(
        {"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission, **empty}
    )


def opened(page: Browser, url: str, *, width: int = 1200, dark: bool = False) -> Hand:
    page.visit(url, width=width, height=844, dark=dark, phone=width < 500)
    hand = Hand(page)
    hand.judged()
    return hand


def test_a_plan_through_a_hill_is_found_dragged_until_proved_saved_sent_and_verified(
    page: Browser, tmp_path: Path
) -> None:
    file, folder = tmp_path / "somebody.plan", tmp_path / "missions"
    folder.mkdir()
    file.write_text(plan_file())
    (folder / "hills.yaml").write_text(HILLS)
    with serving(folder / "hills.yaml", folder) as server:
        hand = opened(page, server.url)
        hand.drop(file)
        hand.until("document.querySelector('#file-verdict.unsafe')")
        words = page.evaluate("document.querySelector('#file-findings').innerText")
        assert "too low above ground" in words
        assert "quarry" in words
        at_item = "[...document.querySelectorAll('#file-findings li')].find((e) => e.innerText.includes('too low'))"
        item = page.evaluate(
            f"(() => {{ const b = {at_item}.querySelector('button'); b.click(); return b.innerText; }})()"
        )
        assert page.evaluate("document.querySelector('#place .mark.broken b').textContent") == item.lower()
        assert page.evaluate("document.querySelectorAll('.along .finding').length") > 0  # in the profile, too
        (x, y), (mark_x, mark_y) = hand.at("#map-frame canvas"), hand.at("#place .mark.broken")
        assert abs(x - mark_x) + abs(y - mark_y) < 30.0  # the map has gone there
        assert [f.name for f in folder.iterdir()] == ["hills.yaml"]
        hand.click("#file-anew")
        hand.until("document.querySelector('#verdict strong').textContent === 'The mission has a mistake'")
        assert "quarry" in page.evaluate("document.querySelector('#verdict').innerText")
        hand.click("#zoom-all")
        page.settle()
        x, y = hand.at("#grip-0-via-0")
        hand.drag([(x, y), (x, y + 30), (x, y + 60)])
        hand.judged()
        hand.click("#save")
        assert eventually(lambda: "via:" in (folder / "hills.yaml").read_text())
        hand.click("#fly-sim")
        assert "is verified" in sent(hand)
        assert page.complaints() == []
        assert all(url.removeprefix("blob:").startswith(server.url.rpartition("/")[0][:20]) for url in page.requests())
    assert "# of all" in (folder / "hills.yaml").read_text()
    assert [v.verdict.safe for v in plan(load_mission(folder / "hills.yaml")).vehicles] == [True]


def test_zones_show_what_was_understood_and_are_added_after_a_choice(page: Browser, tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT)
    kml = "".join(
        f"<Placemark><name>{name}</name>{shape}</Placemark>" for name, shape in (
            ("wood", "<Polygon><outerBoundaryIs><LinearRing><coordinates>8.52,46.5 8.53,46.5 8.53,46.51 8.52,46.5"
             "</coordinates></LinearRing></outerBoundaryIs></Polygon>"),
            ("<![CDATA[<img src=x onerror=alert(1)>]]>", "<LineString><coordinates>8.5,46.5 8.6,46.5</coordinates>"
             "</LineString>"))
    )  # fmt: skip
    (tmp_path / "up").mkdir()
    (tmp_path / "up" / "zones.kml").write_text(
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{kml}</Document></kml>'
    )
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        hand = opened(page, server.url)
        hand.drop(tmp_path / "up" / "zones.kml")
        hand.until("document.querySelector('#file-error')?.textContent.includes('half-width')")
        assert page.evaluate("document.querySelector('#file-add').disabled")
        hand.click("#file-ignore-lines")
        hand.until("document.querySelector('#file-count')?.textContent.includes('1 zone understood')")
        assert "<img" in page.evaluate("document.querySelector('#file').innerText")  # by its name, and no element
        hand.click("#file-add")
        hand.until("document.querySelector('[data-name=wood]')")
        hand.judged()
        assert (tmp_path / "zones.kml").exists()
        assert page.complaints() == []


def test_forms_and_text_change_each_other_and_a_mistake_is_said_at_its_line(page: Browser, tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT)
    text = "document.querySelector('#yaml')"
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        hand = opened(page, server.url)
        page.evaluate("document.querySelector('#keys-open').focus()")
        hand.key("Enter")
        hand.until(f"{text}.value.includes('min_agl_m: 30')")
        assert page.evaluate("document.activeElement.id") == "section"
        hand.write("#key-limits-min_agl_m", "32,5")  # a decimal comma
        hand.until(f"{text}.value.includes('min_agl_m: 32.5')")
        hand.write("#key-limits-max_agl_m", "1,500")  # no guess whether it is one
        hand.until("document.querySelector('#key-limits-max_agl_m-problem').textContent.includes('1.500 or 1500')")
        hand.write("#key-limits-max_agl_m", "")
        typed = f"{text}.value = {text}.value.replace('32.5', 'x')"
        change = f"(() => {{ {typed}; {text}.dispatchEvent(new Event('input')); }})()"
        page.evaluate(change)
        hand.click("#yaml-take")
        hand.until("document.querySelector('#yaml-problems button')?.textContent === 'Line 5'")
        assert page.evaluate(f"{text}.value.slice({text}.selectionStart, {text}.selectionEnd)").startswith("limits:")
        assert page.evaluate("document.querySelector('#key-limits-min_agl_m').value") == "32.5"  # the last good state
        page.evaluate(change.replace("'32.5', 'x'", "'min_agl_m: x', 'min_agl_m: 40'"))
        hand.click("#yaml-take")
        hand.until("document.querySelector('#key-limits-min_agl_m').value === '40'")
        hand.judged()
        page.evaluate("document.querySelector('#section').value = 'vehicles[0]'")
        page.evaluate("document.querySelector('#section').dispatchEvent(new Event('change'))")
        hand.until("document.querySelector('#key-vehicles-0-speed_m_s')")
        hand.write("#key-vehicles-0-speed_m_s", "[3, 12]")
        hand.until(f"{text}.value.includes('speed_m_s: [3, 12]')")
        nameless = "filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim()))"
        controls = "[...document.querySelectorAll('button, input, select, textarea')].filter((e) => e.offsetParent)"
        assert page.evaluate(f"{controls}.{nameless}.map((e) => e.outerHTML)") == []
        hand.key("Escape")
        assert page.evaluate("document.querySelector('#sheet').hidden")
        assert page.evaluate("document.activeElement.id") == "keys-open"
        assert page.complaints() == []


@pytest.mark.parametrize(("width", "dark"), [(1200, True), (390, False)], ids=["dark", "phone"])
def test_file_and_forms_fit_a_phone_and_a_dark_room(page: Browser, tmp_path: Path, width: int, dark: bool) -> None:
    (tmp_path / "hills.yaml").write_text(HILLS)
    (tmp_path / "a.plan").write_text(plan_file())
    with serving(tmp_path / "hills.yaml", tmp_path) as server:
        hand = opened(page, server.url, width=width, dark=dark)
        hand.drop(tmp_path / "a.plan")
        hand.until("document.querySelector('#file-verdict.unsafe')")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        hand.click("#keys-open")
        hand.until("document.querySelector('#yaml')?.value")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.complaints() == []
