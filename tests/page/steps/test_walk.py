"""An operator's walk over the page of `gcsplan map`, by mouse alone, in a real browser: from nothing to a briefing."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from tests.page.browser_hand import IN_A_BROWSER, Hand
from tests.page.steps.test_flight_steps import field, flying
from tests.page.talk import Page, get, serving
from tests.support.browser import Browser

pytestmark = [pytest.mark.nightly, *IN_A_BROWSER]


MIDDLE_OF_PATH = """(() => {
  const path = document.getElementById('path'), {x, y} = path.getPointAtLength(path.getTotalLength() / 2);
  const spot = new DOMPoint(x, y).matrixTransform(path.getScreenCTM());
  return [spot.x, spot.y];
})()"""


def at_rest(hand: Hand) -> None:
    """Wait until the path and its way home are judged, so that the panel does not move any more."""
    hand.until("!document.querySelector('#fly-upload').disabled")
    hand.until("!document.querySelector('#rest').innerText.includes('being judged')")


def press(hand: Hand, selector: str) -> None:
    """A click on a button once it can be pressed."""
    hand.until(f"document.querySelector({json.dumps(selector)})?.disabled === false")
    hand.click(selector)


def sent(hand: Hand) -> str:
    """Upload through the dialogue; the words at its end."""
    at_rest(hand)
    press(hand, "#fly-upload")
    press(hand, "#upload-send")
    hand.until("document.querySelector('#upload-end')")
    return str(hand.page.evaluate("document.querySelector('#upload').innerText"))


def saved(hand: Hand) -> None:
    press(hand, "#save")
    if hand.page.evaluate("document.getElementById('ask').open"):
        hand.click("#ask .main")
    hand.until("document.getElementById('save').textContent === 'Saved'")


def test_from_nothing_to_a_verified_upload_an_obstacle_and_the_briefing(page: Browser, tmp_path: Path) -> None:
    begun_s, taken = time.perf_counter(), list[str]()

    def done(what: str) -> None:
        taken.append(f"{what} after {time.perf_counter() - begun_s:.0f} s")

    with serving(None, tmp_path) as server:
        page.visit(server.url)
        hand = Hand(page)
        assert page.evaluate("document.querySelectorAll('#first li').length") == 3
        for choice in ("[value=sample]", "[value=metres]", "#begin"):
            hand.click(choice)
        hand.until("document.body.classList.contains('placing')")
        x, y = hand.at("#map-frame canvas")
        for place in ((x - 40, y + 60), (x + 50, y + 20)):
            hand.click(place)
            page.settle()
            hand.until("document.querySelectorAll('.grips .point').length > 0")
        hand.judged()
        done("planned and proved")
        saved(hand)
        at_rest(hand)
        hand.click("#fly-sim")
        press(hand, "#fly-connect")
        hand.until("document.querySelector('.mark.live')")
        done("connected")
        words = sent(hand)
        assert "is verified" in words
        done("uploaded and verified")
        hand.click("#upload-close")
        path = page.evaluate("document.getElementById('path').getAttribute('d')")
        hand.click("[data-mode=circle]")
        x, y = page.evaluate(MIDDLE_OF_PATH)
        hand.drag([(x, y), (x + 12, y), (x + 25, y)])
        hand.until("document.querySelector('#zone-name')")
        hand.judged()
        assert page.evaluate("document.getElementById('path').getAttribute('d')") != path
        done("the obstacle is avoided")
        saved(hand)
        at_rest(hand)
        press(hand, "#fly-upload")
        hand.until("document.querySelector('#upload-send')")
        assert "moved since the mission on board" in page.evaluate("document.querySelector('#upload').innerText")
        press(hand, "#upload-send")
        hand.until("document.querySelector('#upload-end.safe')")
        done("uploaded and verified again")
        hand.click("#upload-close")
        press(hand, "#fly-brief")
        hand.until("document.querySelector('#fly-report')")
        done("briefing")
        assert page.complaints() == []
        assert b"mission report" in get(server, "report.html")[2]
    print("; ".join(taken))
    assert "zone 1" in (tmp_path / "mission.yaml").read_text(encoding="utf-8")
    told = json.loads((tmp_path / "mission" / "summary.json").read_text(encoding="utf-8"))
    assert [v["safe"] for v in told["vehicles"]] == [True]


def test_a_vehicle_that_vanishes_is_said_with_the_words_of_the_command_and_a_way_on(
    page: Browser, tmp_path: Path
) -> None:
    with field(tmp_path) as (server, _), flying() as (url, vehicle):
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        at_rest(hand)
        hand.write("#fly-to", url)
        press(hand, "#fly-upload")
        hand.until("document.querySelector('#upload-send')")
        vehicle.misbehave = Misbehaviour.parse("silent_after=0")
        press(hand, "#upload-send")
        hand.until("document.querySelector('#upload-end.unsafe')")
        words = page.evaluate("document.querySelector('#upload').innerText")
        assert "Exit code 6" in words
        assert "no heartbeat of system 1" in words
        assert page.evaluate("!document.querySelector('#upload-again').disabled")
        assert page.complaints() == []


def test_a_second_tab_takes_over_and_the_dialogue_of_the_first_sends_nothing(page: Browser, tmp_path: Path) -> None:
    with field(tmp_path) as (server, _), flying() as (url, vehicle):
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        at_rest(hand)
        hand.write("#fly-to", url)
        press(hand, "#fly-upload")
        hand.until("document.querySelector('#upload-send')")
        with Page(server) as other:
            other.send("hello")
            other.until("plan")
            hand.until("document.querySelector('#upload').innerText.includes('Not connected')")
            assert not page.evaluate("Boolean(document.querySelector('#upload-send'))")
        assert vehicle.items() == ()


@pytest.mark.parametrize(
    ("width", "dark"), [(1200, True), (390, False), (390, True)], ids=["dark", "phone", "dark-phone"]
)
def test_dialogue_and_help_fit_a_phone_and_a_dark_room(page: Browser, tmp_path: Path, width: int, dark: bool) -> None:
    with field(tmp_path) as (server, _):
        page.visit(server.url, width=width, height=844, dark=dark, phone=width < 500)
        hand = Hand(page)
        hand.judged()
        at_rest(hand)
        hand.click("#fly-sim")
        assert "is verified" in sent(hand)
        for dialogue in ("upload", "help"):
            box = f"document.querySelector('#{dialogue}')"
            assert page.evaluate(f"{box}.scrollWidth <= {box}.clientWidth")
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            hand.click(f"#{dialogue}-close")
            hand.click("#help-open")
        controls = "[...document.querySelectorAll('button, input, select')].filter((e) => e.offsetParent)"
        nameless = "filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim()))"
        assert page.evaluate(f"{controls}.{nameless}.map((e) => e.outerHTML)") == []
        assert page.complaints() == []


def test_the_link_and_what_was_sent_survive_a_reload(page: Browser, tmp_path: Path) -> None:
    with field(tmp_path) as (server, _):
        page.visit(server.url)
        hand = Hand(page)
        hand.judged()
        at_rest(hand)
        hand.click("#fly-sim")
        press(hand, "#fly-connect")
        hand.until("document.querySelector('.mark.live')")
        page.visit(server.url)
        hand.judged()
        assert page.evaluate("document.querySelector('#fly-to').value") == "sim"
        hand.until("document.querySelector('#fly-connect').textContent === 'Disconnect'")
        hand.until("document.querySelector('.mark.live')")
        assert page.complaints() == []
