"""Sentences on mission files of ground stations (.waypoints, .plan), and on the fence that is made of zones."""

TEXTS = {
    "home_row_without_place": "the home row holds no place (0, 0): the mission's own home was taken",
    "home_row_at_zero": "the home row holds the place 0, 0, which is what a vehicle without a position writes",
    "home_row_missing": "the file has no home row: the mission's own home was taken",
    "six_decimals": (
        "the coordinates have six decimals (0.11 m), as MAVProxy and pymavlink save them: coarser than the wire, so "
        "this file cannot verify exactly what is on board"
    ),
    "plan_home_missing": "the file has no home: the mission's own home was taken",
    "plan_home_without_place": "the file's home holds no place (0, 0): the mission's own home was taken",
    "plan_without_autopilot": "the file does not say for which autopilot it is: it was read for {autopilot}",
    "plan_rally_points_unread": "the file's {keys} was not read; {cure}",
    "plan_fence_unread": "the file's {keys} is not read: {cure}",
    "plan_breach_return_unread": "the file's fence has a breach return point, which was not read",
    "plan_keys_unread": "these keys of the file were not read: {keys}",
    "plan_list_not_sent": (
        "the file's {key_of_list} ({count} {count:item|items}) is no part of the mission and is not sent with it"
    ),
    "complex_item_read": (
        "{entry} is a {kind}: it was read as the {count} {count:item|items} that it {landing:stands for|holds}"
    ),
    "altitude_shown_is_not_sent": (
        "its Altitude of {shown_m:height} is not the one that is sent, params[6] {sent_m:height}"
    ),
    "item_without_place": "{entry} has no place: it was read as 0, 0, which ArduPilot takes for 'here'",
    "fence_without_heights": ("a fence has no height: {names} would be forbidden from the ground to the sky on board"),
    "fence_leaves_out": ("a fence has no height: {names} {names:is|are} left out of it, having a floor or a ceiling"),
    "fence_circles_inside": "{names} {names:lies|lie} inside another circle of the fence",
}
