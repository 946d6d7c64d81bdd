"""A person at the page of `gcsplan map`: a mouse, a keyboard, and eyes; in a real browser."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.support import browser as chromium
from tests.support.browser import Browser

PROGRAM = chromium.find()
IN_A_BROWSER = (
    pytest.mark.xdist_group("map"),
    pytest.mark.skipif(find_spec("maplibre") is None, reason="the extra map is not installed"),
    pytest.mark.skipif(
        PROGRAM is None,
        reason=f"no browser: none of {', '.join(chromium.NAMES)} is installed (GCSPLAN_CHROMIUM names one)",
    ),
)
"""Marks of tests that look at the page."""

PATIENCE_S = 90.0
CODES = {
    "Enter": 13, "Escape": 27, "Delete": 46, "Tab": 9, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40
}  # fmt: skip
CONTROL = 2


class Hand:
    """Acts on the page that a browser shows."""

    def __init__(self, page: Browser) -> None:
        self.page = page

    def until(self, script: str, seconds: float = PATIENCE_S) -> Any:
        """The value of a script as soon as it is true; true for an element."""
        script = f"((found) => (found instanceof Node ? true : found))({script})"
        end_s = time.monotonic() + seconds
        while not (value := self.page.evaluate(script)):
            assert time.monotonic() < end_s, f"never true: {script}; {self.verdict()}; {self.said()}"
            time.sleep(0.03)
        return value

    def verdict(self) -> str:
        """The first line of the verdict."""
        return str(self.page.evaluate("document.querySelector('#verdict strong')?.textContent || ''"))

    def said(self) -> str:
        """What the page says in its banners, its hint and its console."""
        words = self.page.evaluate("['banners', 'hint'].map((i) => document.getElementById(i)?.innerText).join(' | ')")
        return f"{words} | {self.page.complaints()}"

    def judged(self) -> None:
        """Wait until the search has ended and the path is judged and safe, whatever its way home."""
        safe = "document.querySelector('#verdict strong')?.textContent.endsWith('safe')"
        self.until(f"{safe} && document.getElementById('gap').hidden")

    def at(self, selector: str) -> tuple[float, float]:
        """The middle of an element in the window."""
        found = self.until(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); if (!e) return null; "
            "const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]; })()"
        )
        return found[0], found[1]

    def mouse(self, kind: str, x: float, y: float, *, down: bool = False) -> None:
        """One event of the mouse; ``down``: with the left button held."""
        more: dict[str, Any] = {"button": "left", "buttons": 1} if down else {}
        if kind != "mouseMoved":
            more = {"button": "left", "clickCount": 1, "buttons": int(kind == "mousePressed")}
        self.page.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, where: str | tuple[float, float]) -> None:
        """A click on an element, scrolled into view, or at a point of the window."""
        if isinstance(where, str):
            self.at(where)
            self.page.evaluate(f"document.querySelector({json.dumps(where)}).scrollIntoView({{block: 'nearest'}})")
        x, y = self.at(where) if isinstance(where, str) else where
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def press(self, x: float, y: float) -> None:
        """The button goes down at a point of the window."""
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)

    def drag(self, places: Sequence[tuple[float, float]]) -> None:
        """From the first place over all others, a frame each, and let go at the last."""
        self.press(*places[0])
        for x, y in places[1:]:
            self.mouse("mouseMoved", x, y, down=True)
            self.page.settle()
        self.mouse("mouseReleased", *places[-1])

    def drop(self, file: Path, where: str = "#map-frame canvas") -> None:
        """A file from elsewhere is dragged onto an element, and dropped."""
        x, y = self.at(where)
        data = {"items": [], "files": [str(file)], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.page.ask("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)

    def key(self, name: str, *, control: bool = False) -> None:
        """A key down and up."""
        code = CODES.get(name) or ord(name.upper())
        about = {"key": name, "code": name if len(name) > 1 else f"Key{name.upper()}", "windowsVirtualKeyCode": code}
        text = {"text": "\r"} if name == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            more = text if kind == "keyDown" else {}
            self.page.ask("Input.dispatchKeyEvent", type=kind, modifiers=CONTROL * control, **about, **more)

    def write(self, selector: str, text: str) -> None:
        """Text in place of a field's own, and Enter."""
        self.page.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.focus(); e.select(); }})()"
        )
        self.page.ask("Input.insertText", text=text)
        self.key("Enter")
