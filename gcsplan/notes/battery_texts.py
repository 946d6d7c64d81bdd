"""Sentences on energy and battery."""

TEXTS = {
    "paper_energy": (
        "energy and battery count the paper's 120 J for a metre up or down and 100 J for one along, which say nothing "
        "about this aircraft: give what flying takes under energy: (cruise_w, endurance_min, or what fit-energy finds)"
    ),
    "energy_fitted_elsewhere": (
        "the energy is fitted to flights at {fitted} m/s, and from item {item} on it flies at {speed_m_s:.3g} m/s: "
        "what it needs may be far off; fit the energy to flights at that speed, too"
    ),
    "battery_lasts_unknown": "how long the battery lasts there is not known, for hover_w is 0",
    "battery_until_reserve": (
        "{loop:its round|its hold} has no end: the battery comes to its reserve after {left_s:.0f} s of it"
    ),
}
