"""Simulated vehicles: `gcsplan sim`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.changes import one_wind
from gcsplan.cli.arguments.options import AutopilotOption, FirmwareOption, ListenOption, MisbehaveOption, SimSysidOption
from gcsplan.errors import UsageError


def sim(
    mission: Annotated[
        Path | None,
        typer.Argument(
            metavar="MISSION.yaml", autocompletion=completion.missions, help="One vehicle for each of the mission's."
        ),
    ] = None,
    listen: ListenOption = "udpin:127.0.0.1:14560",
    autopilot: AutopilotOption = None,
    firmware: FirmwareOption = None,
    sysid: SimSysidOption = None,
    misbehave: MisbehaveOption = "",
    wind: Annotated[
        str | None,
        typer.Option(
            "--wind", metavar="M_S,FROM_DEG", help="The wind that each vehicle tells as its estimate (5,270)."
        ),
    ] = None,
) -> None:
    """Simulate a loopback vehicle (or one per vehicle of a mission) that takes missions like a real one.

    Ctrl-C ends it.
    """
    from gcsplan.cli.output.console import remark
    from gcsplan.mavlink.mission.mission import Home
    from gcsplan.sim.vehicle.firmware import firmwares
    from gcsplan.sim.vehicle.loopback import LoopbackVehicle
    from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
    from gcsplan.sim.vehicle.parameters import set_up
    from gcsplan.sim.vehicle.server import SimServer, serve
    from gcsplan.vehicle import Autopilot

    trouble, blows = Misbehaviour.parse(misbehave), one_wind(wind)
    if mission is not None and (autopilot is not None or sysid is not None):
        raise UsageError("--autopilot and --sysid go without a mission file: its vehicles have their own")
    if mission is not None:
        from gcsplan.app.fleet.pipeline import load_mission

        stands = [
            (
                r.vehicle.sysid,
                r.vehicle.autopilot,
                r.start_deg,
                r.start[2],
                set_up(r.vehicle, Home.at(*r.start_deg, r.start[2])),
            )
            for r in load_mission(mission).vehicles
        ]
    elif autopilot is None or autopilot in list(Autopilot):
        kind = Autopilot(autopilot or Autopilot.ARDUCOPTER)
        stands = [(sysid or 1, kind, (36.6, -84.38), 471.0, {})]  # a valley of the sample terrain
    else:
        raise UsageError(f"--autopilot {autopilot}: give one of {', '.join(Autopilot)}")
    versions = firmwares([stand[1] for stand in stands], firmware)
    vehicles = [
        LoopbackVehicle(
            number,
            kind,
            lat_deg=place[0],
            lon_deg=place[1],
            amsl_m=amsl_m,
            misbehave=trouble,
            parameters=own,
            firmware=version,
        )
        for (number, kind, place, amsl_m, own), version in zip(stands, versions, strict=True)
    ]

    for vehicle in vehicles:
        vehicle.wind = blows

    def ready(server: SimServer) -> None:
        names = ", ".join(f"system {v.sysid} ({v.autopilot} {v.firmware.name})" for v in vehicles)
        at = (
            ""
            if mission is not None
            else f" at {stands[0][2][0]:g}, {stands[0][2][1]:g} (with MISSION.yaml: at its start)"
        )
        remark(f"simulating {names}{at}; connect to {server.url_for_gcs}; Ctrl-C ends it")

    serve(vehicles, listen, on_ready=ready)
