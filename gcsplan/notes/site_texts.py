"""Sentences on a file that is checked: its home, its fence, and the hours for which it is judged."""

TEXTS = {
    "home_row_blank": "the file's home row is blank: the vehicle's start in the mission file was taken for home",
    "home_row_elsewhere": (
        "the file's home row lies elsewhere: the vehicle's start in the mission file was taken for home"
    ),
    "home_given": "{key:start} was taken for the file's home",
    "fence_unread": "the file's fence: {why}",
    "brings_fence": (
        "the file brings a fence of its own: {out} {out:area|areas} to stay out of, {inside} to stay inside of"
    ),
    "no_zone_for_fence": "no zone can be sent as a fence: the fence on board is left as it is",
    "flies_beyond_hours": (
        "the hours of zones: those that do not apply from {hours} were left out, and the flight from then on: it lasts "
        "to {until}; write at: [from, to] with all of the flight in it"
    ),
    "hours_without_landing": (
        "the hours of zones: those that do not apply from {hours} were left out, and the flight from then on: it ends "
        "in the air, and when it lands is not known: end it with a landing (a multicopter also with an RTL), or leave "
        "`at` out, so that all zones count"
    ),
}
