"""What tests of the map share: a session at its desk, and a browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.page.browser_hand import PROGRAM
from tests.support import browser as chromium
from tests.support.browser import Browser

if TYPE_CHECKING:
    from tests.page.desk import Desk


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A mission over flat ground, with two zones and comments."""
    from tests.page.desk import FLAT

    (tmp_path / "field.yaml").write_text(FLAT)
    return tmp_path / "field.yaml"


@pytest.fixture
def desk(file: Path) -> Iterator[Desk]:
    """A session of that mission."""
    from tests.page.desk import desk_of

    with desk_of(file, file.parent) as desk:
        yield desk


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser for the tests of a module with the marks `IN_A_BROWSER`."""
    assert PROGRAM is not None
    with chromium.browser(PROGRAM, tmp_path_factory.mktemp("home")) as made:
        yield made
