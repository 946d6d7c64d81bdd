"""The report in a real browser: no error, no request, every figure drawn, in light and dark, on a desk and a phone."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcsplan.check.returns.way_home import way_home
from gcsplan.report.page import render_page
from gcsplan.report.parts.page_data import Subject
from gcsplan.units import AVIATION, IMPERIAL, METRIC, Units
from tests.support import browser as chromium
from tests.support.browser import Browser
from tests.support.pages import HOSTILE, fleet_page, many_page, small_page, verdict_over
from tests.support.shown import same, taken_apart

PROGRAM = chromium.find()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        PROGRAM is None,
        reason=f"no browser: none of {', '.join(chromium.NAMES)} is installed (GCSPLAN_CHROMIUM names one)",
    ),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    assert PROGRAM is not None
    with chromium.browser(PROGRAM, tmp_path_factory.mktemp("home")) as made:
        yield made


def written(folder: Path, units: Units) -> Path:
    """A fleet of two with a way home: every kind of figure is in it."""
    told = fleet_page()
    first = told.subjects[0]
    home = way_home(first.verdict, first.vehicle, told.world, rtl_rel_home_m=20.0)
    page = replace(told, title=HOSTILE, subjects=(replace(first, home=home), *told.subjects[1:]), units=units)
    (folder / "report.html").write_text(render_page(page), encoding="utf-8")
    return folder / "report.html"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("report"), METRIC)


def pixels(page: Browser) -> np.ndarray[tuple[int, int, int], np.dtype[np.int16]]:
    return np.asarray(Image.open(io.BytesIO(page.picture())).convert("RGB"), dtype=np.int16)


def show(page: Browser, selector: str) -> tuple[float, float, float, float]:
    """Scroll to an element; its left, top, width and height in the window."""
    box = page.evaluate(
        f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{block: 'center'}}); "
        "const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
    )
    page.settle()
    return box[0], box[1], box[2], box[3]


def tip(page: Browser) -> str:
    return str(page.evaluate("document.getElementById('tip').hidden ? '' : document.getElementById('tip').innerText"))


@pytest.mark.nightly_but("phone-dark")
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1200, 390], ids=["desk", "phone"])
def test_the_page_is_drawn_without_an_error_or_a_request(page: Browser, report: Path, dark: bool, width: int) -> None:
    page.visit(report, width=width, height=900, dark=dark, phone=width < 500)
    assert page.complaints() == []
    assert page.requests() == [report.as_uri()]
    assert page.evaluate("document.documentElement.scrollWidth") <= width  # nothing sticks out to the right
    figures = page.evaluate("[...document.querySelectorAll('body > :not(.briefing) figure')].map((f) => f.id)")
    assert set(figures) == {"map", "scene", "profile-0", "profile-1", "home-0", "distance", "separation"}
    for name in figures:
        _, _, wide, tall = show(page, f"#{name}")
        assert wide > 0.8 * width - 60 or name == "map", name
        assert tall > 150, name
    paper = pixels(page)[5, 5].mean()
    assert paper < 60 if dark else paper > 200
    assert page.evaluate("document.querySelectorAll('script').length") == 2


@pytest.mark.nightly
def test_the_view_in_space_is_really_drawn_and_can_be_turned(page: Browser, report: Path) -> None:
    page.visit(report)
    left, top, wide, tall = show(page, "#scene")
    assert page.evaluate("document.querySelector('#scene .nothing')") is None
    box = np.s_[int(top) : int(top + tall), int(left) : int(left + wide)]

    def seen() -> np.ndarray[tuple[int, int, int], np.dtype[np.int16]]:
        return pixels(page)[box]

    before = seen()
    assert len(np.unique(before.reshape(-1, 3) // 8, axis=0)) > 300  # ground, zones and tracks, not one colour
    track = np.array([0xB3, 0x15, 0x7E])  # --t1 of the style sheet: both fly the same way, the second is drawn last
    assert (np.abs(before - track).max(axis=2) < 12).sum() > 100
    x, y = left + 0.5 * wide, top + 0.5 * tall
    page.ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
    page.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x + 150, y=y + 20, button="left", buttons=1)
    page.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x + 150, y=y + 20, button="left", clickCount=1)
    page.settle()
    assert (np.abs(seen() - before).max(axis=2) > 20).mean() > 0.1
    assert page.complaints() == []


@pytest.mark.nightly
def test_pointing_tells_numbers_with_their_units_in_every_figure(page: Browser, report: Path) -> None:
    page.visit(report)
    told = {}
    for name, u, v in (
        ("#map", 0.5, 0.05), ("#profile-0 .plot", 0.5, 0.5), ("#home-0 .plot", 0.5, 0.5), ("#distance .plot", 0.5, 0.5),
        ("#separation .plot", 0.5, 0.5), ("#scene", 0.5, 0.6),
    ):  # fmt: skip
        left, top, wide, tall = show(page, name)
        page.point(left + u * wide, top + v * tall)
        told[name] = tip(page)
    assert "ground about" in told["#map"]
    assert "m AMSL" in told["#map"]
    assert "nearest track" in told["#map"]
    assert "its height above ground" in told["#map"]
    assert re.search(r"36\.\d{5}, -84\.\d{5}", told["#map"])
    for words in ("above ground", "lowest allowed", "energy used", "kJ", "along the track"):
        assert words in told["#profile-0 .plot"], words
    assert "return judged at" in told["#home-0 .plot"]
    assert "uav2" in told["#distance .plot"]
    assert "nearest two" in told["#separation .plot"]
    assert "above ground" in told["#scene"]
    assert re.search(r"36\.\d{5}, -84\.\d{5}", told["#scene"])
    left, top, _, _ = show(page, "#map .mark.wp")
    page.point(left, top)
    assert "above ground" in tip(page)
    assert page.complaints() == []


def told_by(page: Browser, report: Path) -> dict[str, str]:
    """What the pointer tells in the middle of each figure."""
    page.visit(report)
    found = {}
    for name in ("#map", "#profile-0 .plot", "#home-0 .plot", "#distance .plot", "#separation .plot"):
        left, top, wide, tall = show(page, name)
        page.point(left + 0.5 * wide, top + (0.05 if name == "#map" else 0.5) * tall)
        found[name] = tip(page)
    assert page.complaints() == []
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("units", [IMPERIAL, AVIATION], ids=["imperial", "aviation"])
def test_the_pointer_tells_the_same_numbers_in_every_system(
    page: Browser, report: Path, units: Units, tmp_path: Path
) -> None:
    metric, others = told_by(page, report), told_by(page, written(tmp_path, units))
    for name, words in metric.items():
        (text, wanted), (other, found) = taken_apart(words), taken_apart(others[name])
        assert other == text, name
        assert wanted, name
        same(found, wanted)
    for name in ("#distance .plot", "#separation .plot"):
        assert re.search(r"time\s+0:\d\d:\d\d\.\d\s", metric[name])
    assert re.search(r"since take-off\s+0:\d\d:\d\d\s", metric["#profile-0 .plot"])
    assert re.search(r"kJ · [\d.\u202f]+ Wh", metric["#profile-0 .plot"].replace("\u202fWh", " Wh"))


@pytest.mark.nightly
def test_the_map_and_a_profile_can_be_enlarged_and_shown_whole_again(page: Browser, report: Path) -> None:
    page.visit(report)
    for name in ("map", "profile-0"):
        view = f"document.querySelector('#{name} svg').getAttribute('viewBox')"
        press = f"document.querySelector('.tools[data-for={name}] [data-do=%s]').click()"
        whole = page.evaluate(view)
        page.evaluate(press % "in")
        page.settle()
        width = [float(page.evaluate(view).split()[2]), float(whole.split()[2])]
        assert width[0] == pytest.approx(width[1] / 1.6, rel=1e-6)
        assert page.evaluate(f"document.querySelectorAll('#{name} .mark.out').length") > 0
        page.evaluate(press % "home")
        assert [float(x) for x in page.evaluate(view).split()] == pytest.approx([float(x) for x in whole.split()])
        assert page.evaluate(f"document.querySelectorAll('#{name} .mark.out').length") == 0


LABELS = """
(() => { const made = []; for (const figure of document.querySelectorAll('#map, .plot')) {
  const frame = figure.getBoundingClientRect(), shown = [...figure.querySelectorAll('.mark:not(.out)')];
  const box = (r) => [r.left, r.top, r.right, r.bottom];
  made.push({
    frame: box(frame),
    labels: shown.filter((m) => !m.classList.contains('mute'))
      .map((m) => box(m.querySelector('b').getBoundingClientRect())),
    symbols: shown.flatMap((m) => { const s = getComputedStyle(m, '::before'), at = m.getBoundingClientRect();
      const r = 0.5 * parseFloat(s.width);
      return s.display === 'none' ? [] : [[at.left - r, at.top - r, at.left + r, at.top + r]]; }),
  }); } return made; })()
"""


@pytest.mark.nightly
def test_labels_lie_on_no_label_and_on_no_symbol_on_a_desk_a_phone_and_on_paper(page: Browser, report: Path) -> None:
    for width in (1200, 390, "paper"):
        page.visit(report, width=1200 if width == "paper" else width)
        if width == "paper":
            page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
            assert abs(page.evaluate("document.body.clientWidth") - 180 / 25.4 * 96) < 1.0
        figures = [f for f in page.evaluate(LABELS) if f["frame"][2] > f["frame"][0]]
        assert len(figures[0]["labels"]) >= 4
        assert len(figures) == 6
        for figure in figures:
            for i, a in enumerate(figure["labels"]):
                for b in figure["labels"][:i] + figure["symbols"]:
                    wide, tall = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
                    assert min(wide, tall) <= 0.5, (width, a, b)
                assert a[0] >= figure["frame"][0]
                assert a[2] <= figure["frame"][2] + 0.5


@pytest.mark.nightly
def test_the_replay_moves_every_figure_by_slider_by_key_and_by_clock(page: Browser, report: Path) -> None:
    for width in (1200, 390):
        page.visit(report, width=width, phone=width < 500)
        left, top, wide, tall = show(page, "#replay input")
        assert page.evaluate("document.querySelectorAll('#map .crafts').length") == 1
        assert page.evaluate("document.querySelector('#map .crafts').hidden")  # nothing over the starts at first
        page.evaluate("document.querySelector('#replay details').open = true")
        for kind in ("mousePressed", "mouseReleased"):
            page.ask("Input.dispatchMouseEvent", type=kind, x=left + wide / 2, y=top + tall / 2, button="left",
                     clickCount=1)  # fmt: skip
        page.settle()
        said = "document.querySelector('#replay output').innerText"
        at = int(page.evaluate("document.querySelector('#replay input').value"))
        assert 240 <= at <= 270
        assert page.evaluate(said) == f"T+0:{at // 60:02d}:{at % 60:02d}"
        row = page.evaluate("document.querySelector('#replay tbody tr').innerText").split("\t")
        assert [row[0], row[1], row[2]] == ["uav1", "flies", "430\u202fm AMSL"]
        assert row[4].endswith("uav2")
        assert page.evaluate("document.querySelectorAll('#map .craft:not([hidden])').length") == 2
        assert page.evaluate("document.querySelector('#profile-0 path.craft').getAttribute('d').length") > 3
        assert page.evaluate("document.querySelector('#distance path.now').getAttribute('d').length") > 3
        page.evaluate("document.querySelector('#replay input').focus()")
        for key, code in (("ArrowRight", 39), (" ", 32)):
            page.ask("Input.dispatchKeyEvent", type="keyDown", key=key, windowsVirtualKeyCode=code)
        value = "+document.querySelector('#replay input').value"
        page.evaluate(
            f"new Promise((r) => {{ const look = () => ({value}) > {at + 2} ? r(1) : setTimeout(look, 50); look(); }})"
        )
        assert page.evaluate("document.querySelector('#replay details').getBoundingClientRect().right") <= width
        play = "document.querySelector('#replay [data-do=play]')"
        assert page.evaluate(f"{play}.getAttribute('aria-label')") == "pause"
        page.evaluate(f"{play}.click()")
        page.evaluate("document.querySelector('#replay [data-do=closest]').click()")
        assert page.evaluate(said) == page.evaluate("document.querySelector('#replay input').ariaValueText")
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        for what in ("#replay", "#map .crafts", "#profile-0 path.craft"):
            assert page.evaluate(f"getComputedStyle(document.querySelector({what!r})).display") == "none"
        assert page.complaints() == []


def test_on_paper_everything_is_unfolded_light_and_the_view_in_space_is_there(page: Browser, report: Path) -> None:
    page.visit(report, dark=True)
    show(page, "#scene")
    colours = (
        "(() => { const c = document.querySelector('#scene canvas.over'); "
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0; "
        "for (let i = 3; i < d.length; i += 4) n += d[i] === 255; return n / (d.length / 4); })()"
    )
    assert page.evaluate(colours) < 0.2  # labels alone
    assert page.evaluate("document.querySelectorAll('details:not([open])').length") > 0
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate("document.querySelectorAll('details:not([open])').length") == 0
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.evaluate(colours) > 0.95
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.evaluate("document.querySelectorAll('details:not([open])').length") > 0
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"


def test_a_tap_tells_numbers_and_the_page_can_still_be_scrolled_by_a_finger(page: Browser, report: Path) -> None:
    page.visit(report, width=390, height=800, phone=True)
    left, top, wide, tall = show(page, "#profile-0 .plot")
    x, y = left + 0.5 * wide, top + 0.5 * tall
    page.ask("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    page.ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    page.settle()
    assert "above ground" in tip(page)
    for name in ("#map", "#scene", "#profile-0 .plot"):
        assert page.evaluate(f"getComputedStyle(document.querySelector({name!r})).touchAction") == "pan-y"
    assert page.complaints() == []


@pytest.mark.nightly
def test_no_label_of_an_axis_makes_a_phones_page_wider_than_the_phone(page: Browser, tmp_path: Path) -> None:
    made = small_page()
    craft = made.subjects[0].vehicle
    short = Subject("uav1", verdict_over(made.world, [[0.0, 0, 430], [1814, 0, 430]], craft), craft)
    text = render_page(replace(made, subjects=(short,), units=AVIATION))  # its last label, 6 000 ft, is at the very end
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    page.visit(tmp_path / "report.html", width=390, height=800, phone=True)
    last = page.evaluate("document.querySelector('#profile-0 .xticks span:last-child').textContent")
    assert re.sub(r"\s", "", last) == "6000"
    assert page.evaluate("document.documentElement.scrollWidth") == 390


@pytest.mark.nightly
def test_without_scripts_the_map_the_profile_and_every_number_are_there(page: Browser, tmp_path: Path) -> None:
    file = tmp_path / "bare.html"
    text = render_page(small_page())
    head, tail = text.rsplit("<script>", 1)
    file.write_text(head + "<script>document.documentElement.dataset.ready='yes'</script>" + tail.split("</script>")[1])
    page.ask("Page.setBypassCSP", enabled=True)  # only for the one line that says that it is loaded
    page.visit(file)
    page.ask("Page.setBypassCSP", enabled=False)
    left, top, wide, tall = show(page, "#map")
    shown = pixels(page)[int(top) : int(top + tall), int(left) : int(left + wide)]
    assert len(np.unique(shown.reshape(-1, 3) // 8, axis=0)) > 100
    assert page.evaluate("getComputedStyle(document.querySelector('#space')).display") == "none"
    assert page.evaluate("document.querySelectorAll('.tools:not([hidden])').length") == 0
    assert "lowest above ground" in page.evaluate("document.body.innerText")


@pytest.mark.nightly
def test_the_filter_narrows_every_table_the_map_and_the_replay(page: Browser, tmp_path: Path) -> None:
    file = tmp_path / "many.html"
    file.write_text(render_page(many_page(130)), encoding="utf-8")
    page.visit(file, width=1200, height=900)
    assert page.complaints() == []
    count = "document.querySelector('label.filter span').textContent"
    assert page.evaluate(count) == "130 of 130"
    profiles = "document.querySelectorAll('#profiles figure').length"
    assert page.evaluate(profiles) == 24
    enter = (
        "(() => {{ const e = document.querySelector('{}'); e.value = '{}'; e.dispatchEvent(new Event('input')); }})()"
    )
    page.evaluate(enter.format("#replay input", 300))
    page.evaluate(enter.format("label.filter input", "uav12"))
    assert page.evaluate(count) == "11 of 130"  # uav12 and uav120 to uav129
    shown = "[...document.querySelectorAll('{}')].filter((e) => !e.hidden && e.style.display !== 'none').length"
    for what, expected in (
        ("#vehicles tr[data-vehicle]", 11), ("#fleet tr[data-vehicle]", 11), ("#map .track", 11),
        ("#map .casing", 11), (".crafts .craft", 11),
    ):  # fmt: skip
        assert page.evaluate(shown.format(what)) == expected, what
    page.evaluate(enter.format("label.filter input", "UAV7 safe"))
    assert page.evaluate(count) == "11 of 130"  # uav7, uav70 to uav79
