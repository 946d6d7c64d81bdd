"""`python -m tests.page.browser_drag`: how long the path takes to follow the pointer, in a real browser.

The goal of the sample mission, with 40 zones, is dragged over 50 places. The time of one place begins with the
pointer's event in the page and ends with the path in its SVG: the page's own work, both ways through the socket, and
the plan. Drawing is apart: the time to the second next frame, on this page and on one that shows an empty map.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from gcsplan.app.session import Planner
from gcsplan.mission_file import load_mission
from tests.page.browser_hand import Hand
from tests.page.talk import serving
from tests.support import browser as chromium
from tests.support.browser import Browser

ZONES, PLACES = 40, 50
LISTEN = """
window.times = {pointer: 0, path: [], plan: [], refused: 0};
addEventListener('pointermove', () => { times.pointer = performance.now(); }, true);
const Plain = WebSocket;
window.WebSocket = class extends Plain {
  constructor(url) {
    super(url);
    this.addEventListener('message', (event) => {
      const message = JSON.parse(event.data);
      if (message.type === 'path' && message.live) times.plan.push(message.elapsed_ms);
      if (message.type === 'refused' && message.live) { times.refused += 1; times.followed?.(); }
    });
  }
};
"""
FOLLOW = """
new MutationObserver(() => { times.path.push(performance.now() - times.pointer); times.followed?.(); })
  .observe(document.getElementById('path'), {attributes: true, attributeFilter: ['d']})
"""
FRAMES = """(async () => {
  const taken = [];
  for (let i = 0; i < 20; i++) {
    const from = performance.now();
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    taken.push(performance.now() - from);
  }
  return taken;
})()"""


def mission_with_zones(count: int) -> str:
    """The sample mission with more zones: small ones in rows, beside its path and over it."""
    text = Path("missions/jacksboro.yaml").read_text(encoding="utf-8")
    known = len(load_mission("missions/jacksboro.yaml").content.given["no_fly"])  # type: ignore[union-attr]
    rows = [
        f"  - {{name: more {k}, center: [{36.60 + 0.013 * (k % 6):.4f}, {-84.35 + 0.024 * (k // 6):.4f}], "
        "radius_m: 60, ceiling_agl_m: 40}\n"
        for k in range(count - known)
    ]
    text = text.replace("way_home: required", "way_home: reported")  # not every return clears the rows
    return text.replace("\nvehicles:\n", "".join(rows) + "\nvehicles:\n", 1)


def dragged(page: Browser, folder: Path, places: int = PLACES) -> dict[str, list[float]]:
    """Milliseconds by name: ``path`` (pointer to path), ``plan`` (in the server), ``judged`` (release to verdict),
    ``whole`` (release to the end of the search), ``frames`` and ``empty`` (two frames, with the mission and on an empty
    map)."""
    file = folder / "zones.yaml"
    file.write_text(mission_with_zones(ZONES), encoding="utf-8")
    page.ask("Page.addScriptToEvaluateOnNewDocument", source=LISTEN)
    hand, found = Hand(page), {}
    with serving(None, folder) as server:
        page.visit(server.url)
        found["empty"] = page.evaluate(FRAMES)
    with serving(file, folder) as server:
        page.visit(server.url)
        hand.judged()
        found["frames"] = page.evaluate(FRAMES)
        page.evaluate(FOLLOW)
        x, y = hand.at("#grip-0-goal")
        hand.press(x, y)
        for k in range(places):
            followed = "times.next = new Promise((done) => { times.followed = () => done(true); }); 0"
            page.evaluate(followed)
            angle = 2.0 * np.pi * k / places
            hand.mouse("mouseMoved", x - 40 - 35 * np.cos(angle), y + 35 * np.sin(angle), down=True)
            page.evaluate("times.next")
        found.update(json.loads(page.evaluate("JSON.stringify({path: times.path, plan: times.plan})")))
        page.evaluate("times.released = performance.now()")
        hand.mouse("mouseReleased", x - 75, y)
        begun = time.perf_counter()
        hand.until("document.querySelector('#verdict:not(.unjudged)')")
        found["judged"] = [1e3 * (time.perf_counter() - begun)]
        hand.judged()
        found["whole"] = [1e3 * (time.perf_counter() - begun)]
        assert page.complaints() == []
    assert Planner(file).mission["vehicles"][0]["goal"] == load_mission(file).content.given["vehicles"][0]["goal"]  # type: ignore[union-attr]
    return found


def table(found: dict[str, list[float]]) -> str:
    """A line for each name: the count, the median and the 90th percentile, ms."""
    return "\n".join(
        f"{name:8} {len(taken):3} times, p50 {np.percentile(taken, 50):7.1f} ms, p90 {np.percentile(taken, 90):7.1f} ms"
        for name, taken in found.items()
    )


def main() -> None:
    """Measure and print."""
    program = chromium.find()
    if program is None:
        sys.exit(f"needs a browser: {', '.join(chromium.NAMES)}, or the one that GCSPLAN_CHROMIUM names")
    with tempfile.TemporaryDirectory() as folder, chromium.browser(program, Path(folder, "home")) as page:
        print(f"{ZONES} zones\n{table(dragged(page, Path(folder)))}")


if __name__ == "__main__":
    main()
