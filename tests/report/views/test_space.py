"""The data of the view in space."""

from __future__ import annotations

from gcsplan.report.views.space import drawn, space_data, space_html
from tests.support.pages import small_page


def test_the_lines_have_as_many_samples_as_their_drawing_needs() -> None:
    page = small_page()
    few, many = (space_data(page, drawn(page, [n] * len(page.subjects)))["lines"] for n in (5, 200))
    assert all(len(a["s"]) < len(b["s"]) for a, b in zip(few, many, strict=True))  # type: ignore[call-overload]
    assert [a["s"][-1] for a in few] == [b["s"][-1] for b in many]  # type: ignore[attr-defined]
    assert 'id="scene"' in space_html(page, drawn(page, [5] * len(page.subjects)).relief)
