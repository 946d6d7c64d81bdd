"""The parameters on board: read before a list is sent, held against what it was judged with, and judged again."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

from gcsplan.mavlink.link.link import Channel, LinkSteps
from gcsplan.mavlink.link.options import Task
from gcsplan.mavlink.link.session.parameters import (
    FENCE_GROUPS,
    PARAMETER_GROUPS,
    judge_fence_parameters,
    judge_parameters,
    settings_words,
)
from gcsplan.mavlink.link.session.px4_motion import slower_words
from gcsplan.mavlink.link.session.recheck import Recheck
from gcsplan.mavlink.link.session.steps import SLOW_ANSWER_S, parameter_steps
from gcsplan.mavlink.link.terrain import TERRAIN_GROUPS, flies_terrain
from gcsplan.mavlink.link.watch import VehicleState, Watch
from gcsplan.mavlink.mission.mission import FENCE, Mission
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.mavlink.mission.parameter_safety import needed_groups
from gcsplan.mavlink.mission.return_route import deciding
from gcsplan.notes.note import Note

__all__ = ["judging", "reading_parameters"]

_LOOK_S = 0.02


def reading_parameters(
    channel: Channel, task: Task, state: VehicleState, watch: Watch, recheck: Recheck
) -> LinkSteps[tuple[list[Note], OnBoard]]:
    """Read the parameters on board; return warnings about those that do not fit the list, and the values read.

    Those that the judge needs are asked for until the timeout.
    """
    options, mission = task.options, task.mission
    warnings: list[Note] = []
    values = OnBoard()
    if mission and options.read_parameters:
        terrain = TERRAIN_GROUPS if flies_terrain(task.items) else ()
        needed = (*needed_groups(options.settings, task.autopilot), *terrain, *deciding(mission))
        values = yield from parameter_steps(
            channel, state, PARAMETER_GROUPS[task.autopilot] + terrain, watch, recheck,
            needed=needed if task.judge is not None else (), most_s=options.timeout_s,
        )  # fmt: skip
        warnings += judge_parameters(
            values, mission, rtl_rel_home_m=options.rtl_rel_home_m, advised_rel_home_m=options.advised_rel_home_m,
            expected=options.expected_parameters, route=options.route,
            settings=options.settings,
        )  # fmt: skip
        warnings += settings_words(options.settings, values, task.autopilot)
        warnings += slower_words(values, options.vehicle) if options.vehicle else []
    if task.mission_type == FENCE and options.read_parameters:
        groups = FENCE_GROUPS[task.autopilot]
        values = yield from parameter_steps(
            channel, state, groups, watch, recheck, needed=groups, most_s=min(SLOW_ANSWER_S, options.timeout_s)
        )
        warnings += judge_fence_parameters(values)
    return warnings, values


def judging(
    channel: Channel, task: Task, mission: Mission, values: Mapping[str, float], recheck: Recheck
) -> LinkSteps[str | None]:
    """Ask the task's judge, beside the other vehicles' transfers; return its answer, None without a judge.

    A judge that has not ended after the timeout has not passed. In simulated time it is asked in line, for there no
    time passes meanwhile.
    """
    judge = task.judge
    if judge is None:
        return None
    clock = channel.link.clock
    if clock is not time.monotonic:
        return judge(mission, values)
    ended: list[str | BaseException | None] = []

    def ask() -> None:
        try:
            ended.append(judge(mission, values))
        except BaseException as error:
            ended.append(error)

    threading.Thread(target=ask, daemon=True, name=f"judge {task.name}").start()
    until = clock() + task.options.timeout_s
    while not ended:
        if clock() >= until:
            return (
                f"it could not be judged with this vehicle's parameters within {task.options.timeout_s:g} s: give more "
                f"--timeout"
            )
        yield clock() + _LOOK_S
        for heard in channel.take():
            recheck.note(heard, clock())
    answer = ended[0]
    if isinstance(answer, BaseException):
        raise answer
    return answer
