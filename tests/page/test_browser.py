"""The page of `gcsplan map` in a real browser: clicked, dragged, typed, saved; no error, no request that leaves."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from gcsplan.app.api import write
from gcsplan.app.session import Planner
from gcsplan.cli.command_table import app
from gcsplan.page.edits import Edits
from gcsplan.page.server import MapServer
from tests.page.browser_drag import dragged, table
from tests.page.browser_hand import IN_A_BROWSER, Hand
from tests.page.talk import FLAT, eventually, serving
from tests.support.browser import Browser

pytestmark = [pytest.mark.slow, *IN_A_BROWSER]
ON_MAP = "#map-frame canvas"
GOAL, START = "#grip-0-goal", "#grip-0-start"


@pytest.fixture
def field(tmp_path: Path) -> Path:
    (tmp_path / "field.yaml").write_text(FLAT, encoding="utf-8")
    return tmp_path / "field.yaml"


@pytest.fixture
def server(field: Path) -> Iterator[MapServer]:
    with serving(field, field.parent) as server:
        yield server


@pytest.fixture
def hand(page: Browser, server: MapServer) -> Hand:
    page.visit(server.url)
    made = Hand(page)
    made.judged()
    return made


def value(page: Browser, selector: str) -> str:
    return str(page.evaluate(f"document.querySelector({json.dumps(selector)}).value"))


def stays_here(page: Browser, server: MapServer) -> bool:
    """Whether every request of the page went to its server, and nothing was reported."""
    assert page.complaints() == []
    return all(url.removeprefix("blob:").startswith(f"http://127.0.0.1:{server.port}/") for url in page.requests())


def test_a_dragged_goal_is_followed_by_a_path_and_judged_on_release(hand: Hand, server: MapServer) -> None:
    page, (x, y), before = hand.page, hand.at(GOAL), value(hand.page, "#place-0-goal")
    solid = page.evaluate("document.getElementById('path').getAttribute('d')")
    hand.press(x, y)
    hand.mouse("mouseMoved", x - 60, y + 40, down=True)
    hand.until("document.getElementById('path').classList.contains('draft')")
    assert hand.verdict() == "A path follows"  # never "safe" before it is judged
    assert value(page, "#place-0-goal") == before  # the mission has not changed
    hand.mouse("mouseReleased", x - 60, y + 40)
    hand.judged()
    assert page.evaluate("document.getElementById('path').getAttribute('class')") == "track t0 judged"
    assert page.evaluate("document.getElementById('path').getAttribute('d')") != solid
    assert value(page, "#place-0-goal") != before
    assert not page.evaluate("document.getElementById('undo').disabled")
    # What is called safe has a safe way home, which is judged after the path.
    hand.until("document.querySelector('[data-key=way_home]')")
    returns = page.evaluate("!document.querySelector('[data-key=way_home].bad')")
    assert hand.verdict() == ("safe" if returns else "path safe")
    assert stays_here(page, server)


@pytest.mark.nightly
def test_a_mission_by_mouse_alone_has_the_bytes_of_the_command_line(page: Browser, tmp_path: Path) -> None:
    with serving(None, tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.click("#begin")  # nothing is assumed: the page requests both choices
        assert page.evaluate("document.querySelectorAll('.problem:not([hidden])').length") == 2
        for choice in ("[value=sample]", "[value=metres]", "#begin"):
            hand.click(choice)
        hand.until("document.body.classList.contains('placing')")
        x, y = hand.at(ON_MAP)
        for place in ((x - 90, y + 20), (x + 60, y - 30)):
            hand.click(place)
            page.settle()
            hand.until("document.querySelectorAll('.grips .point').length > 0")
        hand.judged()
        hand.click("[data-mode=circle]")
        hand.drag([(x - 20, y + 5), (x - 12, y + 5), (x - 4, y + 5)])
        hand.until("document.querySelector('#zone-name')")
        hand.judged()
        hand.click("#save")
        hand.click("#ask .main")
        hand.until("document.getElementById('save').textContent === 'Saved'")
        assert stays_here(page, server)
        shown = page.evaluate("[...document.querySelectorAll('#rest dd')].map((e) => e.innerText)")
    file = next(tmp_path.glob("*.yaml"))
    assert CliRunner().invoke(app, ["plan", str(file), "-o", str(tmp_path / "there")]).exit_code == 0
    planned = Planner(file).plan()
    write(planned, tmp_path / "here")
    names = sorted(f.name for f in (tmp_path / "here").iterdir() if f.is_file())
    assert all((tmp_path / "here" / n).read_bytes() == (tmp_path / "there" / n).read_bytes() for n in names)
    assert any(f"{planned.vehicles[0].verdict.length_m:.0f}" in text.replace("\u202f", "") for text in shown)


@pytest.mark.nightly
def test_everything_is_done_by_the_keyboard_too(hand: Hand) -> None:
    page = hand.page
    before = value(page, "#place-0-goal")
    page.evaluate(f"document.querySelector('{GOAL}').focus()")
    hand.key("ArrowLeft")
    hand.key("ArrowUp")
    hand.until(f"document.querySelector('#place-0-goal').value !== '{before}'")
    assert page.evaluate("document.activeElement.id") == GOAL[1:]  # the focus stays with the point
    hand.judged()
    hand.key("z", control=True)
    hand.until(f"document.querySelector('#place-0-goal').value === '{before}'")
    hand.judged()
    page.evaluate("document.querySelector('[data-mode=via]').focus()")
    hand.key("Enter")
    assert page.evaluate("!document.getElementById('cross').hidden")  # the middle of the map, where Enter puts a point
    hand.key("ArrowRight")
    hand.until("new Promise((done) => setTimeout(() => done(true), 700))")  # the map glides there
    hand.key("Enter")
    hand.until("document.getElementById('grip-0-via-0')")
    hand.judged()
    page.evaluate("document.getElementById('grip-0-via-0').focus()")
    hand.key("Delete")
    hand.until("!document.getElementById('grip-0-via-0')")
    hand.judged()
    hand.write("#place-0-goal", "46°30'36\"N 8°30'18\"E")
    hand.until("document.querySelector('#place-0-goal').value.startsWith('46.51')")
    hand.judged()
    controls = "[...document.querySelectorAll('button, input, select, [role=slider]')].filter((e) => e.offsetParent)"
    nameless = "filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim()))"
    assert page.evaluate(f"{controls}.{nameless}.map((e) => e.outerHTML)") == []
    assert page.complaints() == []


@pytest.mark.nightly
def test_zones_are_drawn_changed_and_deleted(hand: Hand, field: Path) -> None:
    page, (x, y) = hand.page, hand.at(ON_MAP)
    hand.click("[data-mode=polygon]")
    for place in ((x + 150, y + 60), (x + 220, y + 60), (x + 200, y + 130)):
        hand.click(place)
        page.settle()
    hand.click("#finish")
    hand.until("document.querySelector('#zone-name')?.value === 'zone 1'")
    hand.judged()
    corner = hand.at("#zone-corner-0")
    hand.drag([corner, (corner[0] - 20, corner[1] - 10), (corner[0] - 30, corner[1] - 20)])
    hand.judged()
    hand.write("#zone-ceiling", "80")
    hand.until("document.querySelector('.list .chosen small').textContent.includes('80')")
    hand.judged()
    page.evaluate("document.querySelector('#zone-half-0').focus()")
    hand.key("ArrowUp")
    hand.until("document.querySelector('#zone-corner-3')")
    hand.judged()
    hand.key("s", control=True)
    assert eventually(lambda: "zone 1" in field.read_text(encoding="utf-8"))
    text = field.read_text(encoding="utf-8")
    assert "ceiling_agl_m: 80" in text
    assert "# the mast" in text  # comments stay
    hand.click("#zone-delete")
    hand.until("!document.querySelector('#zone-name')")
    hand.judged()
    assert page.complaints() == []


@pytest.mark.nightly
def test_a_button_that_is_drawn_anew_while_it_is_pressed_is_still_pressed(hand: Hand, field: Path) -> None:
    page = hand.page
    hand.until("!document.querySelector('#rest').innerText.includes('being judged')")  # then the panel rests
    page.evaluate("document.querySelector('#zone-list').open = true")
    hand.click("#zone-item-0")
    hand.until("document.querySelector('#zone-delete')")
    page.evaluate("document.querySelector('#zone-delete').scrollIntoView({block: 'center'})")
    hand.press(*hand.at("#zone-delete"))
    field.write_text(FLAT + "# by hand\n", encoding="utf-8")  # the state that follows draws the list anew
    hand.until("document.querySelector('.banner')?.innerText.includes('changed on disk')")
    x, y = hand.at("#zone-delete")  # the banner takes room
    hand.mouse("mouseMoved", x, y, down=True)
    hand.mouse("mouseReleased", x, y)
    hand.until("!document.querySelector('#zone-item-0')")
    hand.judged()


@pytest.mark.nightly
def test_on_paper_there_is_the_whole_mission_and_no_control(hand: Hand) -> None:
    page = hand.page
    hand.drag([(300, 300), (200, 250), (100, 200)])  # the map is moved away
    before = hand.at(GOAL)
    page.ask("Emulation.setEmulatedMedia", media="print")
    page.settle()
    shown = (
        "[...document.querySelectorAll('button:not(.spot):not(.point), input, dialog')].filter((e) => e.offsetParent)"
    )
    assert page.evaluate(f"{shown}.map((e) => e.outerHTML)") == []
    rectangle = "document.querySelector('#place').getBoundingClientRect()"
    left, right, top, bottom = page.evaluate(
        f"(({{left, right, top, bottom}}) => [left, right, top, bottom])({rectangle})"
    )
    for point in (START, GOAL):
        x, y = hand.at(point)
        assert left < x < right, point
        assert top < y < bottom, point
    assert page.evaluate("document.querySelector('#verdict').offsetHeight") > 20
    page.ask("Emulation.setEmulatedMedia", media="screen")
    page.settle()
    assert hand.at(GOAL) == pytest.approx(before, abs=1.0)
    assert page.complaints() == []


@pytest.mark.nightly
def test_without_a_mission_the_place_is_shown_and_a_cure_is_a_button(page: Browser, field: Path) -> None:
    south, north, west, east = 46.508, 46.512, 8.507, 8.513
    boxes = [(south - 0.001, south, west, east), (north, north + 0.001, west, east),
             (south, north, west - 0.001, west + 0.0002), (south, north, east - 0.0002, east + 0.001)]  # fmt: skip
    walls = "".join(
        f"  - {{name: wall {k}, polygon: [[{s}, {w}], [{s}, {e}], [{n}, {e}], [{n}, {w}]], ceiling_agl_m: 80}}\n"
        for k, (s, n, w, e) in enumerate(boxes)
    )
    wall = FLAT.replace("{min_agl_m: 30}", "{min_agl_m: 30, max_agl_m: 60}").replace("no_fly:\n", "no_fly:\n" + walls)
    field.write_text(wall, encoding="utf-8")
    with serving(field, field.parent) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.until("document.querySelector('#verdict.unsafe')")
        assert len(page.evaluate("document.querySelector('#verdict p').textContent")) > 20
        hand.click(".cure button")
        hand.judged()
        assert stays_here(page, server)


@pytest.mark.nightly
def test_a_change_on_disk_and_a_lost_server_are_said(page: Browser, field: Path) -> None:
    with serving(field, field.parent) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        field.write_text(FLAT.replace("name: field", "name: changed"), encoding="utf-8")
        hand.until("document.querySelector('.banner')?.innerText.includes('changed on disk')")
        hand.click(".banner button")
        hand.until("document.getElementById('title').textContent === 'changed'")
        hand.judged()
        assert page.complaints() == []
    hand.until("document.querySelector('.banner')?.innerText.includes('connection')")
    assert hand.verdict() == "Not connected"


@pytest.mark.nightly
def test_an_open_page_goes_on_with_the_next_server_and_tells_no_other_its_token(page: Browser, field: Path) -> None:
    with serving(field, field.parent) as server:
        page.visit(server.url)
        hand, address = Hand(page), server.address
        hand.judged()
        hand.drag([hand.at(GOAL), (hand.at(GOAL)[0] - 40, hand.at(GOAL)[1])])
        hand.until("!document.getElementById('undo').disabled")
        moved = value(page, "#place-0-goal")
        hand.judged()
        hand.until("!document.getElementById('fly-upload').disabled")
        page.evaluate("document.getElementById('fly-sim').click()")
        page.evaluate("document.getElementById('fly-connect').click()")
        hand.until("document.querySelector('.mark.live')")
        eventually(lambda: Edits.of_file(field).can_undo)  # kept within a second
    hand.until("document.querySelector('.banner')?.innerText.includes('connection')")
    with socket.create_server(("127.0.0.1", address.port)) as stranger:
        stranger.settimeout(20.0)
        heard = b""
        for _ in range(3):
            connection, _ = stranger.accept()
            with connection:
                heard += connection.recv(65536)
                connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\nConnection: close\r\n\r\nno")
        hand.until("document.querySelector('.banner')?.innerText.includes('Another program')")
    assert b"GET /proof/" in heard
    assert address.token.encode() not in heard
    with serving(field, field.parent, address):
        hand.until("!document.querySelector('.banner.bad')")
        hand.judged()
        assert value(page, "#place-0-goal") == moved  # the edits that were not saved
        hand.until("document.getElementById('fly-said').innerText.includes('Connected again to sim')")
        hand.until("document.querySelector('.mark.live')")
        assert page.evaluate("document.getElementById('fly-connect').textContent") == "Disconnect"
        assert not page.evaluate("document.getElementById('undo').disabled")
        page.visit(server.url)  # a reload
        hand.judged()
    assert value(page, "#place-0-goal") == moved


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("width", "dark"), [(1200, True), (390, False), (390, True)], ids=["dark", "phone", "dark-phone"]
)
def test_the_page_fits_a_phone_and_a_dark_room(page: Browser, server: MapServer, width: int, dark: bool) -> None:
    page.visit(server.url, width=width, height=844, dark=dark, phone=width < 500)
    hand = Hand(page)
    hand.judged()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    buttons = "[...document.querySelectorAll('button:not(.spot), select')].filter((e) => e.offsetParent)"
    assert page.evaluate(f"{buttons}.filter((e) => e.offsetHeight < 24).map((e) => e.outerHTML)") == []
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(20, 24, 29)") == dark
    assert stays_here(page, server)


@pytest.mark.nightly
def test_a_path_follows_every_place_with_little_time_of_the_page(page: Browser, tmp_path: Path) -> None:
    found = dragged(page, tmp_path)
    print(table(found))
    assert len(found["path"]) == len(found["plan"]) == 50
    own_ms = np.median(found["path"]) - np.median(found["plan"])  # without the plan: two ways, a frame, the drawing
    assert own_ms < 60.0


@pytest.mark.nightly
def test_a_mistake_is_said_at_its_field_and_what_was_typed_stays(hand: Hand) -> None:
    page, field, goal = hand.page, "#field-limits-min_agl_m", value(hand.page, "#place-0-goal")
    page.evaluate("document.querySelector('#limit-list').open = true")
    hand.write(field, "-5")
    hand.until(f"document.querySelector('{field}-problem').textContent.includes('at least')")
    assert value(page, field) == "-5"
    assert hand.verdict() == "The mission has a mistake"
    hand.write(field, "40")
    hand.judged()
    hand.write("#place-0-goal", "nowhere")
    hand.until("document.querySelector('#place-0-goal-problem').textContent.includes('no place')")
    assert value(page, "#place-0-goal") == "nowhere"
    hand.judged()  # the mission keeps its goal
    hand.key("Escape")
    assert value(page, "#place-0-goal") == goal
    assert page.complaints() == []
