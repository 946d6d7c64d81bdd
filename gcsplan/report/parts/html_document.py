"""One HTML document: style and scripts inside, nothing from elsewhere, and no other script can run."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources

from gcsplan import __version__
from gcsplan.report.parts.html import esc


def document(
    title: str,
    body: str,
    data: str,
    *,
    scripts: Sequence[str],
    styles: Sequence[str] = ("report.css",),
    what: str = "mission report",
) -> str:
    """The whole page: ``body`` and ``data`` (blocks for the scripts) are HTML, ``what`` stands behind the title.

    ``scripts`` and ``styles`` are names in ``assets/``.
    """
    style = "".join(_asset(name) for name in styles)
    script = "(function(){\n'use strict';\n" + "\n".join(_asset(name) for name in scripts) + "\n})();"
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    # Nothing is loaded from elsewhere, and no other script can run, whatever the names in a file contain.
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; base-uri 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<meta name="generator" content="gcsplan {esc(__version__)}">'
        f"<title>{esc(title)} – {what}</title><style>\n{style}</style></head>"
        f'<body>{body}<div id="tip" role="status" hidden></div>{data}<script>{script}</script></body></html>\n'
    )


def _asset(name: str) -> str:
    return resources.files("gcsplan.report").joinpath("assets", name).read_text(encoding="utf-8")
