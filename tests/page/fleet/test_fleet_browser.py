"""A fleet on the page of `gcsplan map` in a real browser: made by clicks, arrivals dragged, replayed, in space."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from gcsplan.app.api import rehearse, write
from gcsplan.app.session import Planner
from gcsplan.cli.command_table import app
from tests.page.browser_hand import IN_A_BROWSER, Hand
from tests.page.fleet.test_fleet_server import VEHICLES, mission
from tests.page.steps.test_walk import sent
from tests.page.talk import FLAT, serving
from tests.support.browser import Browser

pytestmark = [pytest.mark.nightly, pytest.mark.slow, *IN_A_BROWSER]
ON_MAP = "#map-frame canvas"
ENDS = [((-150, 80), (150, -60)), ((-170, 10), (160, 10)), ((-110, 110), (170, 70))]
"""Start and goal of each further vehicle, in pixels from the middle of the map."""

SPOTS = "document.querySelectorAll('#place .crafts .craft').length"


def planned(hand: Hand) -> None:
    """Wait until the newest change is judged."""
    hand.until("!document.querySelector('#time-rows.old') && document.querySelector('#time .lanes')")
    hand.judged()


def add(hand: Hand, count: int) -> None:
    """Add vehicles by two clicks each."""
    for start, goal in ENDS[:count]:
        hand.until("!document.querySelector('[data-home]')")  # the panel does not move any more
        before = hand.page.evaluate("document.querySelectorAll('#fleet .crew li').length || 1")
        hand.click("#vehicle-add")
        for dx, dy in (start, goal):
            x, y = hand.at(ON_MAP)
            hand.click((x + dx, y + dy))
            hand.page.settle()
        hand.until(f"document.querySelectorAll('#fleet .crew li').length === {before + 1}")
        planned(hand)


def names(hand: Hand) -> list[str]:
    """The vehicles in the order of arrival, as the time line shows them."""
    found: list[str] = hand.page.evaluate(
        "[...document.querySelectorAll('#time .lanes .item')].map((e) => e.innerText)"
    )
    return found


def drag_arrival(hand: Hand, vehicle: int, dx: float, dy: float) -> None:
    x, y = hand.at(f"#arrive-{vehicle}")
    hand.drag([(x, y), (x + 0.5 * dx, y + 0.5 * dy), (x + dx, y + dy)])
    planned(hand)


def test_four_by_clicks_with_dragged_arrivals_are_saved_sent_verified_and_rehearsed(
    page: Browser, tmp_path: Path
) -> None:
    with serving(None, tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        for choice in ("[value=sample]", "[value=metres]", "#begin"):
            hand.click(choice)
        hand.until("document.body.classList.contains('placing')")
        for _ in range(3):
            hand.click("#zoom-in")
            hand.until("new Promise((done) => setTimeout(() => done(true), 400))")
        x, y = hand.at(ON_MAP)
        for place in ((x - 60, y + 90), (x + 60, y - 70)):
            hand.click(place)
            page.settle()
        hand.judged()
        page.evaluate("document.querySelector('#limit-list').open = true")
        hand.write("#field-planner-gap_percent", "3")  # so that no search ends by the clock of a busy machine
        hand.until("document.querySelector('#field-planner-gap_percent').value === '3'")
        hand.judged()
        add(hand, 3)
        assert names(hand) == ["uav1", "uav2", "uav3", "uav4"]
        drag_arrival(hand, 2, 40.0, 0.0)
        drag_arrival(hand, 3, 0.0, -56.0)
        assert names(hand) == ["uav1", "uav4", "uav2", "uav3"]
        hand.click("#save")
        hand.click("#ask .main")
        hand.until("document.getElementById('save').textContent === 'Saved'")
        hand.click("#fly-sim")
        words = sent(hand)
        assert "4 vehicles are verified" in words
        hand.click("#upload-close")
        assert [words for words in page.complaints() if "404" not in words] == []  # tiles beside the terrain
        assert all(url.removeprefix("blob:").startswith(f"http://127.0.0.1:{server.port}/") for url in page.requests())
        shown = page.evaluate("[...document.querySelectorAll('#time .at')].map((e) => e.innerText)")
    text = (tmp_path / "mission.yaml").read_text(encoding="utf-8")
    assert "# Place of the take-off, on the ground. Required." in text
    assert text.index("#link: ") < text.index("name: uav2")
    arrival = yaml.safe_load(text)["arrival"]
    assert arrival["order"] == ["uav1", "uav4", "uav2", "uav3"]
    assert arrival["interval_s"] > 30
    assert (
        CliRunner().invoke(app, ["plan", str(tmp_path / "mission.yaml"), "-o", str(tmp_path / "there")]).exit_code == 0
    )
    own = Planner(tmp_path / "mission.yaml").plan()
    write(own, tmp_path / "here")
    files = sorted(f.name for f in (tmp_path / "here").iterdir() if f.is_file())
    assert all((tmp_path / "here" / n).read_bytes() == (tmp_path / "there" / n).read_bytes() for n in files)
    assert rehearse(own).safe is True
    assert own.fleet is not None
    found = [own.fleet.slot(name).arrive_s for name in arrival["order"]]
    seconds = [sum(60**k * int(part) for k, part in enumerate(reversed(words.split(":")))) for words in shown]
    assert all(abs(a - b) <= 0.51 for a, b in zip(found, seconds, strict=True))


def test_a_fleet_is_replayed_and_seen_in_space_while_it_is_edited(page: Browser, tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT, encoding="utf-8")
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        add(hand, 2)
        hand.click("#show-space")
        hand.until("document.querySelector('.stretch:not([hidden])')")
        hand.click("#time-closest")
        hand.until(f"{SPOTS} === 3")
        assert page.evaluate("document.querySelector('#replay output').innerText").startswith("T+0:0")
        assert page.evaluate("[...document.querySelectorAll('#time .now')].every((e) => !e.hidden)")
        assert page.evaluate("document.querySelector('#place .mark.tight').innerText").endswith("m")
        assert page.evaluate("document.querySelector('#below path.craft').getAttribute('d')").startswith("M")
        hand.click("#zoom-all")
        hand.until("new Promise((done) => setTimeout(() => done(true), 300))")
        x, y = hand.at("#grip-1-goal")
        hand.press(x, y)
        for step in (10, 20, 30):
            hand.mouse("mouseMoved", x + step, y + step, down=True)
            page.settle()
        hand.until("data.lines.some((line) => line.draft && line.name === 'uav2')")
        assert page.evaluate("data.lines.filter((line) => line.draft).length") == 1  # the others are judged
        assert page.evaluate(SPOTS) == 0  # the replay was that of another path
        hand.mouse("mouseReleased", x + 30, y + 30)
        planned(hand)
        hand.until("data.lines.length === 3 && data.lines.every((line) => !line.draft)")
        assert page.complaints() == []


def test_a_fleet_is_edited_by_the_keyboard_alone(page: Browser, tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT, encoding="utf-8")
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        page.evaluate("document.getElementById('vehicle-add').focus()")
        hand.key("Enter")
        hand.until("document.activeElement.tagName === 'CANVAS'")
        for _ in range(2):
            hand.key("ArrowRight")
            hand.until("new Promise((done) => setTimeout(() => done(true), 700))")
        hand.key("Enter")
        hand.until("document.getElementById('crew-begun')")
        hand.key("ArrowUp")
        hand.until("new Promise((done) => setTimeout(() => done(true), 700))")
        hand.key("Enter")
        hand.until("document.getElementById('arrive-1')")
        planned(hand)
        page.evaluate("document.getElementById('arrive-1').focus()")
        hand.key("ArrowRight")
        hand.key("ArrowRight")
        hand.until("document.getElementById('arrival-interval_s')?.value === '32'")
        planned(hand)
        assert page.evaluate("document.activeElement.id") == "arrive-1"  # the focus stays
        hand.key("ArrowUp")
        hand.until("document.querySelector('#time .lanes .item').innerText === 'uav2'")
        planned(hand)
        hand.write("#vehicle-name", "north")
        hand.until("document.querySelector('#time .lanes .item').innerText === 'north'")
        planned(hand)
        hand.key("z", control=True)
        controls = (
            "[...document.querySelectorAll('button, input, select, [role=slider]')].filter((e) => e.offsetParent)"
        )
        nameless = "filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim()))"
        assert page.evaluate(f"{controls}.{nameless}.map((e) => e.outerHTML)") == []
        assert page.complaints() == []


def test_a_vehicle_that_cannot_come_in_time_is_left_out_by_a_click(page: Browser, tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(FLAT, encoding="utf-8")
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        add(hand, 1)
        page.evaluate("document.getElementById('arrival').open = true")
        hand.write("#arrival-arrive_s", "3:00")
        hand.until("document.querySelector('#verdict strong').textContent === 'No mission'")
        page.evaluate(
            "[...document.querySelectorAll('.cure button')].find((e) => e.innerText.includes('leave_out')).click()"
        )
        hand.until("document.querySelector('#fleet small.bad, #verdict.unsafe')")
        assert page.complaints() == []


@pytest.mark.parametrize(("width", "dark"), [(1200, True), (390, False), (390, True)], ids=["dark", "phone", "both"])
def test_time_line_and_space_fit_a_phone_and_a_dark_room(page: Browser, tmp_path: Path, width: int, dark: bool) -> None:
    (tmp_path / "field.yaml").write_text(FLAT, encoding="utf-8")
    with serving(tmp_path / "field.yaml", tmp_path) as server:
        page.visit(server.url, width=width, height=844, dark=dark, phone=width < 500)
        hand = Hand(page)
        hand.judged()
        add(hand, 1)
        for button in ("#show-space", "#show-replay"):
            page.evaluate("window.scrollTo(0, 0)")  # a phone's header lies over what is scrolled below it
            hand.click(button)
        hand.until("document.querySelector('#replay output')")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        buttons = "[...document.querySelectorAll('button:not(.spot), select')].filter((e) => e.offsetParent)"
        assert page.evaluate(f"{buttons}.filter((e) => e.offsetHeight < 24).map((e) => e.outerHTML)") == []
        assert page.complaints() == []


def test_of_many_vehicles_one_is_told_in_full_and_each_turn_is_reached_by_dragging(
    page: Browser, tmp_path: Path
) -> None:
    with serving(mission(tmp_path, VEHICLES), tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        planned(hand)
        hand.until("!document.querySelector('[data-home]')")
        told = page.evaluate("document.querySelector('#verdict p').innerText")
        assert told == f"{VEHICLES} vehicles: path safe; safe return from all of it"
        hand.click("#vehicle-5")
        hand.until("document.querySelector('#rest > [data-vehicle=\"5\"]')")
        assert page.evaluate("document.querySelectorAll('#rest > [data-vehicle]').length") == 1
        lanes = "document.querySelector('#time .lanes')"
        x, y = hand.at("#arrive-0")
        hand.press(x, y)
        bottom = page.evaluate(f"{lanes}.getBoundingClientRect().bottom")
        for height in (y + 30, bottom - 6):
            hand.mouse("mouseMoved", x, height, down=True)
        hand.until(f"{lanes}.scrollTop + {lanes}.clientHeight > {lanes}.scrollHeight - 2")
        hand.until(f"document.querySelector('#time .head p').innerText.includes('number {VEHICLES} of {VEHICLES}')")
        hand.mouse("mouseReleased", x, bottom - 6)
        planned(hand)
        assert names(hand)[-1] == "uav1"
        hand.click("#show-replay")
        hand.until(f"{SPOTS} === {VEHICLES}")
        assert page.evaluate("[...document.querySelectorAll('#place .crafts b')].map((e) => e.innerText)") == ["uav6"]
        hand.click("#fly-sim")
        assert f"{VEHICLES} vehicles are verified" in sent(hand)
        assert page.evaluate("document.querySelectorAll('#upload details.vehicle:not([open])').length") == VEHICLES
        assert page.complaints() == []
