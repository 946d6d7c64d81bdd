"""Sentences on what an autopilot does with a mission's items, and on what of it is not judged."""

TEXTS = {
    "returns_by_itself": (
        "after the last item ArduPlane returns home by itself (RTL): that return is not judged; end the mission with a "
        "landing, a loiter or an RTL"
    ),
}
