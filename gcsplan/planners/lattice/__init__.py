"""Paths by A* over a lattice of reachable altitudes, for a maximum AGL and climb limits; the entry is `planner`."""
