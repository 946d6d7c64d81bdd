"""Sentences on limits that a mission breaks, and on how near it comes to those that it keeps."""

TEXTS = {
    "after_jump": "{way}, after the jump at item {jump}",
    # -- limits ------------------------------------------------------------------------------------------------------
    "too_low": (
        "too low above ground: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "too_high": (
        "too high above ground: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "above_ceiling": (
        "above {key:max_amsl_m}: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "near_rising_ground": (
        "too near to rising ground at flight level: {value_m:height.2}, limit {limit_m:height.2} (by {by_m:height.2}) "
        "at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "inside_zone": (
        "inside no-fly zone “{zone}” or its clearance (by {by_m:distance.2}) at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "inside_fence_area": (
        "inside the fence's area “{zone}” or its clearance (by {by_m:distance.2}) at {lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.1}"
    ),
    "outside_fence_area": "leaves the fence's area “{zone}” (by {by_m:distance.1})",
    "far_outside_fence_area": "leaves the fence's area “{zone}”, which is far away",
    "climbs_too_steeply": (
        "climbs too steeply: {value_deg:.2f} deg, limit {limit_deg:.2f} deg (by {by_deg:.2f} deg) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "descends_too_steeply": (
        "descends too steeply: {value_deg:.2f} deg, limit {limit_deg:.2f} deg (by {by_deg:.2f} deg) at {lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1}"
    ),
    "glides_too_steeply": "glides down too steeply: {value_deg:.2f}°, limit {limit_deg:g}°",
    "near_ground_on_slant": (
        "the {glide:glide|climb-out} comes too near to the ground, by {by_m:height.2}, at {lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.1}{obstacles}"
    ),
    "obstacles_beside_strip": (
        "; from twice {key:altitude_error_m} above the strip on trees and buildings count too, and "
        "{key:obstacle_height_m} puts them everywhere: above {key:altitude_error_m} no way over level ground clears "
        "them. Where the way is open, give `canopy`, a raster with 0 there, in place of {key:obstacle_height_m}"
    ),
    # -- terrain, battery, autopilot ---------------------------------------------------------------------------------
    "over_unknown_ground": (
        "over ground that the terrain model does not know at {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "over_ground_unread": (
        "over ground that the vehicle's terrain grid does not know, on the way to {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}"
    ),
    "too_far_away": ("goes to {lat:.6f}, {lon:.6f}, {amsl_m:amsl.1}: too far from the mission's terrain to be judged"),
    "battery_not_enough": (
        "battery: the flight needs {needs_j:joules} and {usable_j:joules} may be used ({battery_j:joules} less "
        "{reserve_percent:g} % reserve)"
    ),
    "too_many_items": "the mission has {count} items and {autopilot} takes {most}",
    "refused_on_upload": "would be refused on upload: {why}",
    "item_unreached": "item {by} {jumps:jumps back|holds} without end: item {item} is never reached",
    "items_unreached": "item {by} {jumps:jumps back|holds} without end: items {item} to {last} are never reached",
    # -- how near a mission comes to a limit: heights are not those of the table of legs, which has the path as it is --
    #    planned, so the words say which way they go
    "lowest_above_ground": (
        "lowest above ground, less the errors: {value_m:height.1 down} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "highest_above_ground": (
        "highest above ground, with the errors: {value_m:height.1 up} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "highest_altitude": (
        "highest altitude, with the errors: {value_m:height.1 up} of {limit_m:height bare}, {left}, item {seq} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "lowest_within_clearance": (
        "lowest above ground within the clearance, less the errors: {value_m:height.1 down} of {limit_m:height bare}, "
        "{left}, item {seq} ({lat:.6f}, {lon:.6f}, {amsl_m:amsl.0})"
    ),
    "steepest_climb": (
        "steepest climb: {value_deg:angle.1 up} of {limit_deg:g}, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "steepest_descent": (
        "steepest descent: {value_deg:angle.1 up} of {limit_deg:g}, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "nearest_zone": (
        "nearest to zone {zone}: {value_m:distance.1 down} of {limit_m:distance bare}, {left}, item {seq} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.0})"
    ),
    "nearest_inside_zone": (
        "inside zone {zone}: {value_m:distance.1 up} from its edge, {left}, item {seq} ({lat:.6f}, {lon:.6f}, "
        "{amsl_m:amsl.0})"
    ),
    "spare_height": "{room_m:height.1 down} to spare",
    "spare_distance": "{room_m:distance.1 down} to spare beyond the track error",
    "spare_angle": "{room_deg:angle.1 down} to spare",
    "broken_height": "broken by {room_m:height.1 up}",
    "broken_distance": "broken by {room_m:distance.1 up} with the track error",
    "broken_angle": "broken by {room_deg:angle.1 up}",
    # -- in a rehearsal ----------------------------------------------------------------------------------------------
    "flew_too_low": (
        "{name} came too low above ground by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_too_high": (
        "{name} came too high above ground by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_above_ceiling": (
        "{name} came above {key:max_amsl_m} by {by_m:height.2} at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_near_rising_ground": (
        "{name} came too near to rising ground at its level by {by_m:height.2} at {time_s:seconds.1}, item {item} "
        "({lat:.6f}, {lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_into_zone": (
        "{name} came into no-fly zone “{zone}” or its clearance by {by_m:distance.2} at {time_s:seconds.1}, item "
        "{item} ({lat:.6f}, {lon:.6f}, {amsl_m:amsl.1})"
    ),
    "flew_over_unknown_ground": (
        "{name} came over ground that the terrain model does not know at {time_s:seconds.1}, item {item} ({lat:.6f}, "
        "{lon:.6f}, {amsl_m:amsl.1})"
    ),
}
