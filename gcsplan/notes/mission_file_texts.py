"""Sentences on how the keys of a mission file, and the options that stand for them, were read."""

TEXTS = {
    "value_converted": "{given} {symbol}, read as {own_key}: {value}",
    "charge_converted": "{given} {symbol} at {volts:g} V, read as {own_key}: {value}",
    "key_read_as_another": "read as {own_key}",
    "and_as_many_more": "{note} (and {count} more)",
    "more_values_converted": "{count} more values are converted from other units",
    "place_is_a_square": "'{given}' is a square of {size} in MGRS; its south-west corner is taken",
    "zone_letter_is_the_hemisphere": (
        "the S of zone {zone}S is the southern hemisphere: the northing is not in band S"
    ),
    "limit_assumed": "{limit:key} is not given, {value:g} is taken",
    "plane_climb_assumed": "{key:max_climb_deg} is not given, {climb_deg:g} is taken for a plane",
    "one_speed": "speed_m_s is one number, read as [{slow_m_s:g}, {fast_m_s:g}]: always this speed",
    "lean_bounds_speed": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: a lean of {lean_deg:g}°"
        "{by_default:, ArduCopter's default,| (lean_angle_deg)} allows about that"
    ),
    "lean_bounds_speed_curably": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: a lean of {lean_deg:g}°"
        "{by_default:, ArduCopter's default,| (lean_angle_deg)} allows about that; for {wanted_m_s:speed} write "
        "lean_angle_deg: {needs_deg}, and set {setting}"
    ),
    "velocity_bounds_speed": (
        "planned with {most_m_s:speed}, not {wanted_m_s:speed bare}: MPC_XY_VEL_MAX {most_m_s:g} m/s"
        "{by_default:, PX4's default,| (mpc_xy_vel_max_m_s)} allows no more; for {wanted_m_s:speed} write "
        "mpc_xy_vel_max_m_s: {wanted_m_s:g}, and set MPC_XY_VEL_MAX {wanted_m_s:g}"
    ),
    "motion_unbounded": (
        "in local metres {keys} bound nothing unless they are given: flight times are the ideal ones of the papers"
    ),
    "terrain_error_without_frame": "{key:terrain_error_m} counts with altitude_frame: terrain only",
    "cruise_is_base_power": (
        "{given_key} {given:g} is read as base_w {base_w:.4g}, the power for as long as it flies, and "
        "horizontal_j_per_m 0"
    ),
    "cruise_is_base_power_climb_of_paper": (
        "{given_key} {given:g} is read as base_w {base_w:.4g}, the power for as long as it flies, and "
        "horizontal_j_per_m 0; a metre up or down takes {vertical_j_per_m:g} J, as in the paper, unless "
        "vertical_j_per_m is given"
    ),
    "energy_in_part_of_paper": (
        "{costs} {costs:is the paper's|are the paper's}, not this aircraft's, for `energy:` says nothing of "
        "{costs:it|them}"
    ),
    "key_and_value": "{name} {value:g}",
    "hover_below_base_power": (
        "hover_w {hover_w:g} is less than base_w {base_w:.4g}, the power of flying at any speed: a hold counts "
        "{base_w:.4g} W"
    ),
    "start_at_home": "the vehicle reports no position: its home is the start",
    "start_at_vehicle": "the start is where the vehicle is, {away_m:distance.0} from its home",
    "position_of_armed_vehicle": "the vehicle is armed: its position may not be on the ground",
    "parameters_not_read": "no parameters could be read: the return altitude is left open",
    "ground_is_flat": "the ground is flat at {flat_m:height} above sea level in this mission: no hill is seen",
}
