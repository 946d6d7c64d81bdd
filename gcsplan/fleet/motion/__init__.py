"""How each autopilot flies a path in time."""
