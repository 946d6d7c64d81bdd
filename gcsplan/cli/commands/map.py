"""`gcsplan map`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.options import UnitsChoice, UnitsOption
from gcsplan.errors import UsageError


def map_(
    mission: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MISSION.yaml]",
            autocompletion=completion.missions,
            help="The mission file, or sample:NAME; without one the page begins from nothing.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(metavar="N", help="Port at 127.0.0.1 [default: a free one].")] = 0,
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
    from gcsplan.page.map_session import MapSession
    from gcsplan.page.server import MapServer, files_served
    from gcsplan.page.steps.flight_steps import PageSteps
    from gcsplan.units import units_of

    files_served()  # before the mission is read: the extra may be missing
    below = None if base is None else BaseMap(base)
    edits = Edits.of_folder(Path()) if mission is None else Edits.of_file(mission)
    session = MapSession(edits, units_of(units.value), PageSteps, None if below is None else below.as_dict())
    try:
        server = MapServer(session, port=port, base=below)
        server.start()
        try:
            say(f"the map is at {server.url}")
            remark("Ctrl-C ends it")
            if browser:
                _open(server.url)
            while server.wait(0.2):
                pass
        finally:
            server.stop()
    finally:
        broken_off = session.steps.close()
        if broken_off:
            remark(broken_off)
        kept = session.close()
        if kept is not None:
            remark(f"note: edits that are not saved are kept in {kept}; the next gcsplan map of this mission has them")


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
