"""axe-core, the checker of accessibility: found on this machine, or taken from npm's registry; never kept here."""

from __future__ import annotations

import os
import shutil
import subprocess
import tarfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.support.browser import Browser

PACKAGE = "axe-core@4.14.1"
FETCH_S = 60.0
SERIOUS = ("serious", "critical")

RUN = """axe.run(document, {resultTypes: ['violations']}).then((found) => found.violations
  .filter((v) => %s.includes(v.impact))
  .map((v) => `${v.impact} ${v.id}: ${v.help}; ${v.nodes.slice(0, 4).map((n) => n.html.slice(0, 160)).join(' | ')}`))"""


@cache
def source() -> str:
    """The script of axe-core: the file that GCSPLAN_AXE names, or the package that `npm pack` brings. Skips the test,
    with the reason, where there is neither."""
    named = os.environ.get("GCSPLAN_AXE")
    if named:
        return Path(named).read_text(encoding="utf-8")
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("no axe-core: npm is not installed (GCSPLAN_AXE names axe.min.js)")
    with TemporaryDirectory() as folder:
        try:
            subprocess.run(
                [npm, "pack", PACKAGE, "--silent", "--pack-destination", folder], check=True, capture_output=True,
                timeout=FETCH_S,
            )  # fmt: skip
        except (subprocess.SubprocessError, OSError) as why:
            pytest.skip(f"no axe-core: npm pack {PACKAGE} failed: {type(why).__name__} (GCSPLAN_AXE names axe.min.js)")
        with tarfile.open(next(Path(folder).glob("axe-core-*.tgz"))) as packed:
            script = packed.extractfile("package/axe.min.js")
            assert script is not None
            return script.read().decode()


def serious(page: Browser) -> list[str]:
    """What axe-core finds serious or worse in the page as it is now, each with its rule and elements."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(f"(() => {{ {source()}; return 0; }})()")
    found: list[Any] = page.evaluate(RUN % list(SERIOUS))
    return [str(v) for v in found]
