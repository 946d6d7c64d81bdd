"""Paths of arcs and tangents for fixed wings, their profile and repair; `planner` is its door."""
