"""Sentences on a rehearsal: what was not kept, what was not flown, and how it was flown."""

TEXTS = {
    # -- what was not kept
    "never_arrived": "{name} never arrived at its goal",
    "never_arrived_for": "{name} never arrived at its goal: {why}",
    "hit_ground": "it hit the ground at {speed_m_s:speed.1} on its way to item {item}",
    "left_auto": "it left AUTO for {mode} at item {item}",
    "time_was_up": "it still flew to item {item} when the time was up",
    "other_ground": (
        "that is {height_m:height.0} above the mission's ground: without terrain an SITL's ground is flat at the "
        "altitude of home, and --sitl-binary starts one with the mission's terrain"
    ),
    "vehicle_said": "it said: {texts}",
    "arrived_late": "{name} arrived {late_s:seconds} late, after {took_s:seconds} instead of {told_s:seconds}",
    "down_late": "{name} was down {late_s:seconds} late, after {took_s:seconds} instead of {told_s:seconds}",
    "battery_used_up": (
        "{name} used {used_percent:.0f} % of its battery{paper: (paper's figures)|}, of which {reserve_percent:g} % "
        "must stay"
    ),
    "order_lost": "the order of arrival was {came}; planned was {planned}",
    "came_too_near": (
        "{first} and {second} came as near as {distance_m:distance.1 down}, needed are {needed_m:distance}, at "
        "{time_s:seconds.1}"
    ),
    "landed_too_near": (
        "{first} landed beside {second}, which stood there: {distance_m:distance.1 down}, needed are "
        "{needed_m:distance}, at {time_s:seconds.1}"
    ),
    "in_some_runs": "{what} (in {runs} of {of_runs} runs)",
    # -- what was not flown
    "circle_not_flown": "its circle is not flown, the simulated vehicle waits at the middle",
    "jump_flown_once": "a jump flies it again and again, the simulated vehicle once",
    "turns_flown_as_corners": "its turns of {radius_m:distance} are flown as corners",
    # -- how it was flown
    "energy_fitted_to_other_air": (
        "its energy is fitted to flights at {slow_m_s:speed bare} to {fast_m_s:speed} through the air, and it flew at "
        "{speed_m_s:speed.0} in this wind: what it used may be far off"
    ),
    "runs_alike": "without wind, gusts and noise every run is the same: one was flown",
    "released_early": ("every vehicle was released {before_s:g} s before its departure, for its motors to spin up"),
    "left_ground_off_time": "{vehicle} left the ground {off_s:+.1f} s from its departure",
}
