"""A plan as a fragment: what is in it, and that a page with a policy of its own shows it."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.report.views.sketch import JUDGED, sketch_html
from tests.export.test_output_schema import FLAT


class Seen(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [name for name, _ in attrs]


def test_the_sketch_has_map_and_table_and_nothing_that_a_policy_blocks() -> None:
    zone = {"name": "<b>&", "center": {"east_m": 450, "north_m": 120}, "radius_m": 60}
    planned = plan({**FLAT, "no_fly": [zone]})
    html = planned._repr_html_()
    seen = Seen()
    seen.feed(html)
    assert {"svg", "polyline", "circle", "table"} <= set(seen.tags)
    assert not {"script", "style", "link", "img", "image", "iframe", "b"} & set(seen.tags)
    assert not [name for name in seen.attributes if name in ("style", "src", "href") or name.startswith("on")]
    assert "&lt;b&gt;&amp;" in html
    assert JUDGED[True] in html


@pytest.mark.nightly
def test_a_fleet_of_many_has_as_many_rows_as_vehicles() -> None:
    assert len(re.findall("<tr><th>uav", plan("sample:fleet-4")._repr_html_())) == 4
    assert callable(sketch_html)
