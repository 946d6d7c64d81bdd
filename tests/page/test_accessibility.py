"""axe-core over the page of `gcsplan map`: nothing serious, in light and dark and on a phone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("uvicorn", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from tests.page.browser_hand import IN_A_BROWSER, Hand
from tests.page.talk import FLAT, serving
from tests.support.axe import serious, source
from tests.support.browser import Browser

pytestmark = [pytest.mark.nightly, *IN_A_BROWSER]

FLEET = (
    FLAT
    + """\
  - {name: uav2, sysid: 2, autopilot: arducopter, start: [46.501, 8.498], goal: [46.511, 8.506]}
"""
)


WALLED = FLAT.replace("{min_agl_m: 30}", "{min_agl_m: 30, max_agl_m: 60}").replace(
    "no_fly:\n", "no_fly:\n  - {name: lid, center: [46.51, 8.51], radius_m: 200, floor_agl_m: 5}\n"
)


def start(hand: Hand) -> None:
    hand.until("document.querySelector('#start')")


def edit(hand: Hand) -> None:
    hand.judged()


def infeasible(hand: Hand) -> None:
    hand.until("document.querySelector('#verdict.unsafe')")


def forms(hand: Hand) -> None:
    hand.judged()
    hand.page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    hand.page.settle()


def upload(hand: Hand) -> None:
    hand.judged()
    hand.until("document.querySelector('#fly-upload') && !document.querySelector('#fly-upload').disabled")
    hand.page.evaluate("document.querySelector('#fly-sim').click(); document.querySelector('#fly-upload').click()")
    hand.until("document.querySelector('#upload-send')")


VIEWS: dict[str, tuple[str | None, Callable[[Hand], None]]] = {
    "start": (None, start), "edit": (FLAT, edit), "infeasible": (WALLED, infeasible), "fleet": (FLEET, edit),
    "forms": (FLAT, forms), "upload": (FLAT, upload),
}  # fmt: skip


@pytest.mark.parametrize(("width", "dark"), [(1200, False), (1200, True), (390, False)], ids=["light", "dark", "phone"])
@pytest.mark.parametrize("view", VIEWS)
def test_axe_finds_nothing_serious(page: Browser, tmp_path: Path, view: str, width: int, dark: bool) -> None:
    source()
    text, reach = VIEWS[view]
    file = tmp_path / "field.yaml"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    with serving(None if text is None else file, tmp_path) as server:
        page.visit(server.url, width=width, height=844, dark=dark, phone=width < 500)
        reach(Hand(page))
        assert serious(page) == []
