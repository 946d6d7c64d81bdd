"""The commands and their options. Slow packages are imported by the commands that need them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Annotated

import typer

from gcsplan.cli.commands import batch, check, new, plan, rehearse, schema, wind
from gcsplan.cli.commands import fit_energy as energy
from gcsplan.cli.commands import map as page
from gcsplan.cli.commands import sim as fly
from gcsplan.cli.commands import vehicles as links
from gcsplan.cli.commands.bench import bench_app
from gcsplan.cli.commands.dem import dem_app
from gcsplan.cli.commands.terrain import terrain_app
from gcsplan.cli.process.exit import put

app = typer.Typer(
    name="gcsplan",
    help="Plans MAVLink missions over real terrain, proves every metre of them, uploads and verifies them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done, 2 bad input, 3 no mission, 4 violation, 5 refused, 6 unknown or dead link, "
    "7 read-back differs, 70 a bug of ours, 129, 130, 143 interrupted (SIGHUP, Ctrl-C, SIGTERM).",
)
app.add_typer(dem_app, name="dem")
app.add_typer(terrain_app, name="terrain")
app.add_typer(bench_app, name="bench")
app.command(short_help="Write a commented mission file.")(new.new)
app.command("map", short_help="Plan on a map in the browser.")(page.map_)
app.command(short_help="Plan a mission file; upload and verify on request.")(plan.plan)
app.command(short_help="Plan many mission files: a table, a map.")(batch.batch)
app.command(short_help="Plan, fly it all in a simulator, judge.")(rehearse.rehearse)
app.command(short_help="Does a file fly safely in a mission's world?")(check.check)
app.command(short_help="Check files, upload them, read them back, compare.")(links.upload)
app.command(short_help="Is exactly this file on board?")(links.verify)
app.command()(links.download)
app.command(short_help="Remove the mission, fence or rally points.")(links.clear)
app.command(short_help="Loopback vehicles that take missions.")(fly.sim)
app.command(short_help="The winds of a mission, as they are understood.")(wind.wind)
app.command("fit-energy", short_help="The energy model out of flight logs.")(energy.fit_energy)
app.command()(plan.planners)
app.command(short_help="The JSON Schema of a mission file, for editors.")(schema.schema)


def _print_version(is_given: bool) -> None:
    if is_given:
        from gcsplan import __version__

        put(f"{__version__}\n")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def root(
    # eager: it is printed before typer imports what it reads other options with
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback with an error.")] = False,
) -> None:
    """Options of all commands."""


@cache
def commands(called: str) -> Callable[..., object]:
    """The command ``called`` with its options, made once; all commands if there is none of that name.

    typer makes the options of every command that it knows, which takes longer than anything else before a command runs.
    """
    own = [c for c in app.registered_commands if called == (c.name or (c.callback and c.callback.__name__))]
    groups = [g for g in app.registered_groups if g.name == called]
    if not own and not groups:
        return typer.main.get_command(app)
    one = copy.copy(app)
    one.registered_commands, one.registered_groups = own, groups
    return typer.main.get_command(one)
