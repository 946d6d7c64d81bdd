"""Paths of arcs and tangents for fixed wings, their profile and repair; the entry is `planner`."""
