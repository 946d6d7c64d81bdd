"""Planners: a `Problem` in metres goes in, a `Solution` comes out, whoever the planner is."""
