"""Sentences on a plan: its bound, its search, and what of the request had to be changed."""

TEXTS = {
    # -- the bound and the search
    "bound_of_farther_paths": (
        "the terrain was looked at within {within_m:far.1} of the straight track: the lower bound is that of paths "
        "which go farther"
    ),
    "bound_ignores_turns": ("the lower bound is that of paths with sharp corners: it ignores {key:turn_radius_m}"),
    "bound_by_cells": "the lower bound knows the room between min and max AGL only cell by cell of the terrain",
    "bound_with_climb_out": ("the lower bound is that of missions with this climb-out{approach: and this approach|}"),
    "planned_again": (
        "planned {times} times, each time with larger margins: the first mission breaks a limit as it is flown"
    ),
    "searches_failed": ("{searches} {searches:search|searches} of {optimiser} ended without a path before this one"),
    "curve_pushed": (
        "the curve that {optimiser} found breaks {broken}; it was pushed sideways by up to {pushed_m:distance.0} and "
        "given new altitudes, and it passes the check"
    ),
    "curve_lifted": (
        "the curve that {optimiser} found breaks {broken}; it was given new altitudes, and it passes the check"
    ),
    "curve_thinned": "the curve that {optimiser} found breaks {broken}; its way points pass",
    "limits_broken": "limits on {legs} of its legs ({limits})",
    "limit_by_length": "{limit} by {by_m:height.1}",
    "limit_by_angle": "{limit} by {by_deg:.1f} °",
    "zone_by": "zone '{zone}' by {by_m:distance.1}",
    "more_limits": "{count} more",
    "only_way_points_break": "no limit, but its way points do",
    # -- the request
    "takeoff_raised": (
        "{key:takeoff_agl_m} {asked_m:height} raised to {raised_m:height.2}: so far the ground rises within the track "
        "error"
    ),
    "approach_raised": (
        "{key:approach_agl_m} {asked_m:height} raised to {raised_m:height.2}: so far the ground rises within the track "
        "error"
    ),
    "via_moved": "via point {via} is moved {aside_m:distance} aside: the climb there is on the spot",
    "flown_as_quadplane": (
        "arduplane with {key:turn_radius_m} 0 is flown as a VTOL (QuadPlane): vertical take-off and landing; corners "
        "are cut and the landing place is overshot while braking: {key:track_error_m} must hold both"
    ),
    "climb_out": (
        "launch it on a heading of {heading_deg:.0f}°: it climbs straight ahead for {far_m:distance.0} to "
        "{up_m:height.0} above home"
    ),
    "climb_out_in_circles": (
        "launch it on a heading of {heading_deg:.0f}°: it climbs straight ahead for {far_m:distance.0} to "
        "{up_m:height.0} above home, and goes on in circles of {circle_m:distance.0} up to {circled_m:height.0}"
    ),
    "approach": (
        "it lands on a heading of {heading_deg:.0f}°, gliding straight for {far_m:distance.0} from {up_m:height.0} "
        "above the goal"
    ),
    "paper_energy_minimised": "the energy that is minimised is the paper's: a vehicle has no `energy:`",
}
