"""Paths by A* over a lattice of reachable altitudes, for a maximum AGL and for slopes; `planner` is its door."""
