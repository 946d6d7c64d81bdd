"""Sentences on flight logs and on the energy model that is fitted to them."""

TEXTS = {
    "log_damaged": "{log} is damaged in places, which were passed over",
    "places_of_gps": "no POS messages, so the GPS's own places were taken",
    "power_of_system_status": "no BATTERY_STATUS, so SYS_STATUS was taken",
    "lines_passed_over": "passed over {count} {count:line|lines} without numbers",
    "wind_unknown": "no log tells the wind: metres over ground are taken for those through the air",
    "wind_counted": "metres are those through the air, in a wind of {wind_m_s:speed.1} as the log tells it",
    "wind_counted_of_some": (
        "metres are those through the air, in a wind of {wind_m_s:speed.1} as the log tells it; {silent} of {logs} "
        "logs tell none"
    ),
    "nearly_all_climbs": "the vertical metres are nearly all climbs: R1 is theirs alone",
    "nearly_all_descents": "the vertical metres are nearly all descents: R1 is theirs alone",
    "up_and_down_differ": (
        "a metre up costs about {up_j_per_m:.0f} J and a metre down {down_j_per_m:.0f} J; R1 is one number for both, "
        "good for missions that climb as much as they descend"
    ),
    "fit_holds_at_one_speed": (
        "this fit holds at {speed_m_s:speed.1} through the air, and says nothing of other speeds"
    ),
}
