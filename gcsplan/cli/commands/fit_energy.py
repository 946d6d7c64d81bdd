"""`gcsplan fit-energy`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcsplan.cli.arguments.options import JsonOption
from gcsplan.cli.process.exit import emit, put
from gcsplan.errors import CheckFailed, UsageError


def fit_energy(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="ArduPilot .bin, PX4 .ulg, MAVLink .tlog or .csv; several are one fit."),
    ],
    csv_columns: Annotated[
        str,
        typer.Option(
            "--csv-columns",
            metavar="WHAT=NAME,...",
            help="Names of a CSV's columns: time_s, lat, lon (or east_m, north_m), amsl_m, power_w (or volt, amp).",
        ),
    ] = "",
    sysid: Annotated[
        int | None, typer.Option("--sysid", metavar="N", min=1, max=255, help="Which vehicle of a .tlog.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Fit the energy model to flight logs: joules per metre up or down and through the air, and watts.

    Fly parts of it level at two speeds, parts up and down, and hover for half a minute; the log must hold battery
    voltage and current. Standard output is what to paste into a vehicle of the mission file. Exit code 4 means that
    the log does not determine R1 or R2.
    """
    from gcsplan.cli.output.console import remark
    from gcsplan.logs.fit import fit_energy as fit
    from gcsplan.logs.reader import read_log
    from gcsplan.notes.note import Note

    columns = _columns(csv_columns)
    found = fit(read_log(file, columns=columns, sysid=sysid) for file in logs)
    error = None
    if not found.is_complete:
        why = [f"{c.name}: {c.why}" for c in (found.vertical, found.horizontal) if c.value is None]
        error = {
            "code": CheckFailed.exit_code,
            "reason": "not_told",
            "message": "; ".join(why),
            "where": ", ".join(map(str, logs)),
        }
    if as_json:
        emit({"logs": [str(file) for file in logs], "fit": found.as_dict()}, error)
    else:
        remark(
            f"{found.steps} steps of 5 s, {found.energy_j / 1e3:.0f} kJ, {found.speed_m_s:.1f} m/s; the model is off "
            f"by {found.off_percent:.1f} % of a step's energy (median)"
        )
        for note in found.notes:
            remark(f"note: {note}")
        for c in (found.vertical, found.horizontal, found.base, found.hover):
            if c.value is None:
                remark(f"{c.name}: {c.why}")
        if found.base.value is None and found.speed_m_s > 0.0:
            remark(f"note: {Note('fit_holds_at_one_speed', speed_m_s=found.speed_m_s)}")
        put(found.yaml())
    raise typer.Exit(CheckFailed.exit_code if error else 0)


def _columns(text: str) -> dict[str, str]:
    """The table of ``what=name,what=name``; UsageError for other text."""
    found: dict[str, str] = {}
    for part in (p.strip() for p in text.split(",") if p.strip()):
        what, equals, name = part.partition("=")
        if not equals or not name.strip():
            raise UsageError(f"--csv-columns is written time_s=Time,lat=Latitude, given {part!r}")
        found[what.strip()] = name.strip()
    return found
