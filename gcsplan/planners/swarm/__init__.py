"""Planners by swarm optimisers: encoding, cost, scene, repair, and ants; `planner` is the door of all but `aco`."""
