"""`gcsplan map`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.options import UnitsChoice, UnitsOption
from gcsplan.errors import UsageError

if TYPE_CHECKING:
    from gcsplan.page.server import MapServer

COMES_BACK_S = 2.5
"""Seconds within which an open page looks for its server again."""


def map_(
    mission: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MISSION.yaml]",
            autocompletion=completion.missions,
            help="The mission file, or sample:NAME; without one the page begins from nothing.",
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(metavar="N", help="Port at 127.0.0.1 [default: the last one of this mission, or a free one].")
    ] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    base: Annotated[
        str | None,
        typer.Option(
            metavar="MAP", help="Map below it all: an .mbtiles or .pmtiles file, or an address with {z}, {x} and {y}."
        ),
    ] = None,
    units: UnitsOption = UnitsChoice.METRIC,
) -> None:
    """Plan on a map in the browser: click two places, drag, and the path that is proved follows (extra `map`).

    Everything stays on this machine: the page comes from a server at 127.0.0.1, whose address nobody else knows. The
    page saves the mission file, with its comments; edits that are not saved are kept beside it when the command ends.
    """
    if not 0 <= port <= 65535:
        raise UsageError(f"--port {port}: give a number from 1 to 65535")
    from gcsplan.cli.output.console import remark, say
    from gcsplan.page.base_map import BaseMap
    from gcsplan.page.edits import Edits
    from gcsplan.page.guard import PageAddress
    from gcsplan.page.map_session import MapSession
    from gcsplan.page.server import MapServer, files_served
    from gcsplan.page.steps.flight_steps import PageSteps
    from gcsplan.units import units_of

    files_served()  # before the mission is read: the extra may be missing
    below = None if base is None else BaseMap(base)
    edits = Edits.of_folder(Path()) if mission is None else Edits.of_file(mission)
    session = MapSession(edits, units_of(units.value), PageSteps, None if below is None else below.as_dict())
    try:
        kept = PageAddress.kept(edits.store.place)
        server = MapServer(session, port=port, base=below, kept=kept)
        server.address.keep(edits.store.place)
        server.start()
        try:
            say(f"the map is at {server.url}")
            remark("Ctrl-C ends it")
            if browser and not (kept is not None and _comes_back(server)):
                _open(server.url)
            while server.wait(0.2):
                pass
        finally:
            server.stop()
            server.address.keep(edits.store.place)  # which may have got a file
    finally:
        broken_off = session.steps.close()
        if broken_off:
            remark(broken_off)
        unsaved = session.close()
        if unsaved is not None:
            remark(
                f"note: edits that are not saved are kept in {unsaved}; the next gcsplan map of this mission has them"
            )


def _comes_back(server: MapServer) -> bool:
    """Whether a page that an earlier run left open connects again, so that no other one has to be opened."""
    end_s = time.monotonic() + COMES_BACK_S
    while time.monotonic() < end_s and server.wait(0.1):
        if server.has_page:
            return True
    return False


def _open(url: str) -> None:
    """Open the page, or say that the user has to."""
    import webbrowser

    from gcsplan.cli.output.console import remark

    try:
        opened = webbrowser.open(url)
    except webbrowser.Error:
        opened = False
    if not opened:
        remark("no browser was found: open the address in one")
