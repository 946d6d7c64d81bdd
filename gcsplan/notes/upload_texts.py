"""Sentences on an upload or a comparison, by what was done before and after it."""

TEXTS = {
    "fence_on_board": "a fence of {items} {items:item|items} is on board too, read back and compared",
    "judged_again_safe": "what is on board is judged again: safe",
    "positions_shifted": (
        "{items} {items:item differs by|items differ by up to} {most_m:distance.3}; judged again: {safe:safe|not safe}"
    ),
    "positions_cut": (
        "{items} {items:item differs by|items differ by up to} {most_m:distance.3}, as {sender} write positions; "
        "judged again: {safe:safe|not safe}"
    ),
}
