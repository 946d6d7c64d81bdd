"""The functions for scripts beside `load_mission` and `plan`, without a command line or asyncio.

    from gcsplan import check, load_mission, plan, rehearse, report, upload, write

    mission = load_mission("fleet.yaml")
    planned = plan(mission)
    write(planned, "fleet", report=True)
    print(check("somebody.plan", mission, vehicle="uav1").describe())
    flown = rehearse(planned, wind_m_s=5.0, noise_m=1.0, runs=50)
    print(flown.safe, flown.p95_s, flown.order_kept_runs)
    for result in upload(planned, to="link", atomic=True):
        print(result.vehicle, result.outcome, result.verified, result.message)

Every function blocks until it is done. Errors are those of `gcsplan.errors`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from gcsplan.app.check.files import check_files, check_mission, in_other_winds
from gcsplan.app.fleet.may_fly import flyable, require_passing
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.output import files as outputs
from gcsplan.app.plan import way_home as returns
from gcsplan.app.plan.arguments import require
from gcsplan.app.plan.flight_hours import within_hours
from gcsplan.app.plan.model import Plan
from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.job import LINK, JobResult, ProgressCall, UploadOptions
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, NoMission, UsageError, elements, wrong_argument
from gcsplan.export.outdir import retire_outputs, settle_outputs, steady, write_outputs, write_whole
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.units import units_of

if TYPE_CHECKING:
    from gcsplan.dem.fetch import Fetched, FetchProgress
    from gcsplan.sim.outcome import Rehearsal

__all__ = ["check", "clear", "download", "fetch_dem", "new", "rehearse", "report", "upload", "verify", "write"]

UnitsName = Literal["metric", "imperial", "aviation"]

Source = MissionFile | str | os.PathLike[str] | Mapping[str, Any]
"""A mission of `load_mission`, or anything that `load_mission` accepts."""


@overload
def check(what: Plan, *, wind: Mapping[str, Any] | None = None) -> dict[str, Verdict]: ...
@overload
def check(
    what: Mission | str | os.PathLike[str],
    within: Plan | Source,
    *,
    vehicle: str | None = None,
    wind: Mapping[str, Any] | None = None,
) -> Verdict: ...
def check(
    what: Plan | Mission | str | os.PathLike[str],
    within: Plan | Source | None = None,
    *,
    vehicle: str | None = None,
    wind: Mapping[str, Any] | None = None,
) -> Verdict | dict[str, Verdict]:
    """Judge mission items along every leg as the autopilot flies them; nothing is planned, written or sent.

    ``what`` is one of three. A plan: every vehicle's items are judged again, and the result is a verdict by vehicle
    name. A `Mission` (such as ``planned.vehicles[0].mission`` or a downloaded one), or the path of any `.waypoints` or
    `.plan` file: the result is one verdict. The last two need ``within``: a plan or a mission (or anything that
    `load_mission` accepts) with the terrain, zones and limits. ``vehicle`` names the vehicle of ``within`` that flies,
    if neither the file's stem nor the mission's name does. ``wind`` has the keys of a mission's `wind` (such as
    ``{"up_to_m_s": 8}``; the path of a forecast is relative to the current folder), which count in place of the
    world's own.

    In a `Verdict`, ``safe`` is True, False or None (something could not be judged: ``not_judged``). ``findings`` state
    which limit is broken on which item. ``legs`` hold heights in m, angles in degrees, times in s and energies in J.
    Each vehicle is judged alone; a plan's separation in the air is ``planned.fleet.separation``.

    Raises InputError for a file that cannot be read, UsageError if it is not clear what is to be judged.

    Examples:
        >>> from gcsplan import check, load_mission, plan
        >>> mission = load_mission({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> planned = plan(mission)
        >>> check(planned)["uav1"].safe
        True
        >>> check(planned.vehicles[0].mission, mission).safe
        True
    """
    require("check", vehicle=vehicle, wind=wind, **({} if isinstance(what, Plan | Mission) else {"what": what}))
    if isinstance(what, Plan):
        if within is not None or vehicle is not None:
            raise UsageError("a plan is judged whole, in its own world: give nothing else to check")
        source = what.source if wind is None else in_other_winds(what.source, wind)
        flies = {r.vehicle.name: r.vehicle for r in source.vehicles} if wind is not None else {}
        verdicts = [
            judge(
                v.mission, flies.get(v.name, v.request.vehicle), what.world, rtl_rel_home_m=v.request.rtl_rel_home_m,
                terrain_error_m=source.terrain_error_m, wind=source.flight_wind(v.request),
            )
            for v in what.vehicles
        ]  # fmt: skip
        if what.fleet is not None:
            verdicts = within_hours(source, what.vehicles, verdicts, what.fleet)
        return {v.name: verdict for v, verdict in zip(what.vehicles, verdicts, strict=True)}
    if within is None:
        raise UsageError("in which world? Give check a plan or a mission file as its second argument")
    if isinstance(within, Plan):
        source = within.source
    else:
        source = within if isinstance(within, MissionFile) else load_mission(within)
    if wind is not None:
        source = in_other_winds(source, wind)
    if isinstance(what, Mission):
        return check_mission(source, what, vehicle).verdict
    file = os.fspath(what)
    with steady([file]):
        [checked] = check_files(source, [file if vehicle is None else f"{vehicle}={file}"])
    return checked.verdict


def write(
    planned: Plan,
    folder: str | os.PathLike[str],
    *,
    report: bool = False,
    way_home: bool = False,
    allow_unjudged: bool = False,
    units: UnitsName = "metric",
) -> list[Path]:
    """Write what ``gcsplan plan -o FOLDER`` writes, the same bytes, whole or not at all; returns the files' paths.

    The files are `.waypoints`, `.plan` and `.param` for each vehicle, `mission.kml`, `mission.geojson`, `profile.csv`
    and `summary.json`; with ``report`` also `report.html`. ``way_home``, and ``report`` too, adds to the summary how
    each vehicle returns from every point, which takes about a second for 20 km. ``units`` are those of the report; all
    other files are in SI.

    Outputs of an earlier plan in ``folder`` are removed; any other file in the way is moved to its ``previous/``.
    Raises CheckFailed if a verdict does not pass (with ``allow_unjudged``, what could not be judged passes), or if the
    mission file says ``way_home: required`` and a return is unsafe or not judged. Where the plan may leave vehicles
    out, such a vehicle is left out; NoMission is raised if none is left. With either error the earlier outputs are
    moved to ``previous/``, so that no old mission is flown by mistake. Raises InputError if ``folder`` cannot be
    written; nothing has changed then.

    Examples:
        >>> import tempfile
        >>> from gcsplan import plan, write
        >>> planned = plan({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [file.name for file in write(planned, folder)]
        ['uav1.waypoints', 'uav1.plan', 'uav1.param', 'mission.kml', 'mission.geojson', 'profile.csv', 'summary.json']
    """
    require(
        "write", planned=planned, folder=folder, report=report, way_home=way_home, allow_unjudged=allow_unjudged,
    )  # fmt: skip
    system = units_of(units)
    settle_outputs(folder)
    try:
        planned, homes = flyable(planned, allow_unjudged=allow_unjudged, home=report or way_home)
    except (CheckFailed, NoMission):
        retire_outputs(folder)
        raise
    files = outputs.outputs_of(planned, homes)
    if report:
        files["report.html"] = outputs.report_of(planned, (), homes, system)
    write_outputs(folder, files)
    return [Path(folder) / name for name in files]


def report(
    planned: Plan,
    file: str | os.PathLike[str] | None = None,
    *,
    results: Sequence[JobResult] = (),
    way_home: bool = True,
    units: UnitsName = "metric",
) -> str:
    """The report of a plan as HTML text: map, profiles and tables on one page that needs no network.

    With ``file`` the report is also written there, whole or not at all (UTF-8). ``results`` of `upload` are shown on
    the page. ``way_home``: the return of each vehicle from every point is judged and shown, which takes about a second
    for 20 km. ``units`` are those of its numbers. Raises InputError if ``file`` cannot be written, UsageError for units
    that are not known.

    Examples:
        >>> from gcsplan import plan, report
        >>> planned = plan({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> report(planned, way_home=False).startswith("<!DOCTYPE html>")
        True
    """
    require("report", planned=planned, file=file, way_home=way_home)
    system = units_of(units)
    results = elements("report()", "results", results, JobResult, "the results of upload()")
    text = outputs.report_of(planned, results, returns.homes_of(planned) if way_home else {}, system)
    if file is not None:
        write_whole(Path(file), text)
    return text


def upload(
    planned: Plan,
    to: str | Sequence[str] | Mapping[str, str] = LINK,
    *,
    atomic: bool = False,
    allow_unjudged: bool = False,
    allow_armed: bool = False,
    ignore_position: bool = False,
    allow_parameters: bool = False,
    timeout_s: float = 60.0,
    progress: ProgressCall | None = None,
) -> list[JobResult]:
    """Upload every mission of a plan, all at once, read each back, compare, and check what was read back.

    ``to`` is a URL for all vehicles (distinguished by system id), ``"link"`` (the mission file's links), ``"sim"`` (a
    simulated vehicle for each), ``"NAME=URL"``, a list of these, or a mapping from name to URL. Vehicles without a
    target are left out. With ``atomic``, if one upload fails, the missions that the others took are cleared again.
    ``timeout_s`` is the longest time without progress. With ``allow_parameters`` a vehicle whose parameters are outside
    of the mission's list is judged with them instead of refused. ``progress(name, progress)`` is called during the
    uploads.

    Returns one `JobResult` per vehicle, in the plan's order: ``verified`` is True only if the mission was read back and
    equals what was sent; ``message`` says what went wrong. A failure of one vehicle does not affect the others and
    raises nothing; `gcsplan.app.upload.run.exit_code` sums them up. Raises UsageError for bad targets and for a common
    start that is past, near or far, and, before anything is sent, CheckFailed if a verdict does not pass, or a return
    with ``way_home: required``.
    """
    require(
        "upload", planned=planned, to=to, timeout_s=timeout_s, progress=progress, atomic=atomic,
        allow_unjudged=allow_unjudged, allow_armed=allow_armed, ignore_position=ignore_position,
        allow_parameters=allow_parameters,
    )  # fmt: skip
    if isinstance(to, Mapping):
        pairs = elements("upload()", "to", to.items(), tuple, "a mapping from name to URL")
        words = [f"{name}={url}" for name, url in pairs]
    else:
        words = (
            [to] if isinstance(to, str) else list(elements("upload()", "to", to, str, "a URL, or a list of NAME=URL"))
        )
    GateTime.require_of(planned)
    targets = uploads.targets(words, [v.request.vehicle for v in planned.vehicles])
    require_passing({v.name: v.verdict for v in planned.vehicles if v.name in targets}, allow_unjudged=allow_unjudged)
    homes = returns.judged(planned, home=False)
    from gcsplan.sim.vehicle.server import loopback_fleet

    options = UploadOptions(
        allow_armed=allow_armed, ignore_position=ignore_position, allow_parameters=allow_parameters, atomic=atomic,
        timeout_s=float(timeout_s),
    )  # fmt: skip
    return uploads.run_jobs(
        uploads.jobs_of(planned, targets, homes, bool(homes)), options, progress, simulator=loopback_fleet
    )


def rehearse(
    planned: Plan,
    *,
    wind_m_s: float | None = None,
    from_deg: float | None = None,
    gusts_m_s: float = 0.0,
    noise_m: float = 0.0,
    runs: int = 1,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
    jobs: int | None = 1,
    cluster: Any = None,
) -> Rehearsal:
    """Upload a plan to simulated vehicles, fly what they store in simulated time, and judge that; all on this machine.

    Wind, gusts and position noise (`gcsplan.sim.flight.wind.Weather`) are drawn from ``seed``, anew for each of
    ``runs``. With ``wind_m_s`` None and no gusts each run draws one of the winds that the mission declares, with gusts
    of its own; a mission that declares none is flown in still air. ``progress(done, runs)`` is called from time to
    time. ``jobs`` processes or the workers of ``cluster`` share the runs, as in `plan`, with the same result. The
    result's ``safe`` is True if the arrivals were in order, and the separation and every limit were kept on the flown
    tracks; ``error()`` states what was not kept. Raises what
    an upload raises, CheckFailed as `upload` does for a return that is required, and InputError for invalid weather.
    """
    from gcsplan.app import rehearse as rehearsing

    require(
        "rehearse", planned=planned, wind_m_s=wind_m_s, from_deg=from_deg, gusts_m_s=gusts_m_s, noise_m=noise_m,
        runs=runs, seed=seed, progress=progress, jobs=jobs, cluster=cluster,
    )  # fmt: skip
    returns.judged(planned, home=False)
    if seed is None or seed < 0:
        raise wrong_argument("rehearse()", "seed", seed, "a whole number, 0 or more")
    wind_m_s, from_deg = (None if value is None else float(value) for value in (wind_m_s, from_deg))
    weather = rehearsing.weather_of(planned.source, wind_m_s, from_deg, float(gusts_m_s), float(noise_m))
    return rehearsing.rehearse(
        planned, weather=weather, runs=runs, seed=seed, progress=progress, jobs=jobs, cluster=cluster
    )


def verify(
    file: str | os.PathLike[str],
    url: str,
    within: Plan | Source | None = None,
    *,
    sysid: int = 1,
    tolerance_m: float | None = None,
    allow_parameters: bool = False,
    timeout_s: float = 60.0,
) -> JobResult:
    """Compare a `.waypoints` or `.plan` file with the mission on board at ``url``; the vehicle keeps what it has.

    With ``within`` (a plan, a mission, or anything that `load_mission` accepts) the mission on board is also judged
    there with the vehicle's parameters, and ``file`` may be ``NAME=FILE``, by the vehicle's name; its number then
    replaces ``sysid``. ``tolerance_m``: with ``within``, positions that are at most so far away, m, are no difference.

    The result's ``verified`` is True only if exactly this file is on board (and is safe); ``message`` says what is
    not. Raises InputError for a bad file, UsageError for bad arguments, LinkError if nobody answers.
    """
    require(
        "verify", file=file, url=url, sysid=sysid, tolerance_m=tolerance_m, timeout_s=timeout_s,
        allow_parameters=allow_parameters,
    )  # fmt: skip
    source = within.source if isinstance(within, Plan) else within
    if source is not None and not isinstance(source, MissionFile):
        source = load_mission(source)
    return uploads.verify_file(
        os.fspath(file), url, sysid, source=source, tolerance_m=tolerance_m, timeout_s=float(timeout_s),
        allow_parameters=allow_parameters,
    )  # fmt: skip


def download(
    url: str, file: str | os.PathLike[str] | None = None, *, sysid: int = 1, timeout_s: float = 60.0
) -> Mission:
    """Read the mission on board at ``url``; nothing is written to the vehicle.

    With ``file``, a name that ends in `.waypoints` or `.plan`, it is also written there. The result can be handed to
    `check`. Raises LinkError if nobody answers, UsageError for a bad name.
    """
    require("download", url=url, file=file, sysid=sysid, timeout_s=timeout_s)
    if file is None:
        return uploads.mission_on_board(url, sysid, f"vehicle {sysid}", timeout_s=float(timeout_s))
    return uploads.download_to(url, sysid, Path(file), timeout_s=float(timeout_s))


def clear(
    url: str, kind: str = "mission", *, sysid: int = 1, allow_armed: bool = False, timeout_s: float = 60.0
) -> None:
    """Remove the ``mission``, ``fence`` or ``rally`` points on board at ``url``, and read back that nothing is left.

    Raises VehicleRefused, LinkError, and UsageError for another ``kind``.
    """
    require("clear", url=url, kind=kind, sysid=sysid, allow_armed=allow_armed, timeout_s=timeout_s)
    uploads.clear(url, sysid, kind, allow_armed=allow_armed, timeout_s=float(timeout_s))


def new(
    start: str,
    goal: str,
    *,
    dem: str | Sequence[str] = (),
    flat_m: float | None = None,
    vertical_datum: str | None = None,
    autopilot: str = "arducopter",
    sysid: int = 1,
    min_agl_m: float = 60.0,
    file: str | os.PathLike[str] | None = None,
) -> str:
    """The text of a new mission file with a comment on every key, read and judged once.

    ``start``, ``goal`` are places as text (degrees, degrees with minutes, UTM, MGRS). The ground is ``dem`` (rasters,
    relative to ``file``) or flat at ``flat_m`` metres above sea level; it is never assumed. With ``file`` the text is
    also written there, unless a file is there already. Raises InputError, UsageError.

    Examples:
        >>> from gcsplan import load_mission, new
        >>> text = new("36.6, -84.3", "36.61, -84.3", flat_m=300)
        >>> load_mission(text).vehicles[0].vehicle.limits.min_agl_m
        60.0
    """
    from gcsplan.app.new_mission import OPTIONS, checked_text
    from gcsplan.mission_file.new_file import Draft, place_text
    from gcsplan.vehicle import Autopilot

    require(
        "new", start=start, goal=goal, flat_m=flat_m, min_agl_m=min_agl_m, sysid=sysid, file=file,
        vertical_datum=vertical_datum, autopilot=autopilot,
    )  # fmt: skip
    rasters = (dem,) if isinstance(dem, str) else elements("new()", "dem", dem, str, "names of raster files")
    if bool(rasters) == (flat_m is not None):
        raise UsageError("the ground is `dem` or `flat_m`: give one of them", where="new()")
    if autopilot not in tuple(Autopilot):
        raise wrong_argument("new()", "autopilot", autopilot, f"one of {', '.join(Autopilot)}")
    try:
        begin, end = place_text(start), place_text(goal)
    except ValueError as why:
        raise UsageError(f"start and goal are places: {why}", where="new()") from None
    target = Path("mission.yaml" if file is None else file)
    if file is not None and os.path.exists(target):  # False for a name that no file can have
        raise UsageError(f"{target} is there already; give another name, or remove it", where="new()")
    draft = Draft(
        start=begin, goal=end, dem=rasters, vertical_datum=vertical_datum,
        flat_m=None if flat_m is None else float(flat_m),
        autopilot=Autopilot(autopilot), sysid=int(sysid), min_agl_m=float(min_agl_m),
    )  # fmt: skip
    names = {key: option.removeprefix("--").replace("-", "_") for key, option in OPTIONS.items()}
    text, _ = checked_text(draft, target, names)
    if file is not None:
        write_whole(target, text)
    return text


def fetch_dem(
    mission: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    *,
    around: str | None = None,
    radius_km: float | None = None,
    tiles: str | None = None,
    source: str | None = None,
    mirror: str = "",
    offline: bool = False,
    progress: FetchProgress | None = None,
) -> Sequence[Fetched]:
    """Bring terrain of a published source into the cache, from where missions take it: the only use of the network.

    The area is one of three: a ``mission``'s, ``around`` a place within ``radius_km``, or ``tiles`` by name.
    ``offline``: only look whether it is there. ``progress(name, bytes, whole)`` is called meanwhile. Returns a row for
    each tile. Raises InputError, UsageError, and LinkError if some tiles could not be had; the others stay.
    """
    from gcsplan.app.tiles import tiles_of
    from gcsplan.dem.cache import Cache
    from gcsplan.dem.fetch import Fetch

    require(
        "fetch_dem", around=around, radius_km=radius_km, tiles=tiles, source=source, progress=progress, mirror=mirror,
        offline=offline,
    )  # fmt: skip
    chosen, cells = tiles_of(mission, around, radius_km, tiles, source)
    cache = Cache(chosen)
    if offline:
        return Fetch(cache).look(cells)
    return Fetch(cache, mirror=mirror, progress=progress).run(cells)
