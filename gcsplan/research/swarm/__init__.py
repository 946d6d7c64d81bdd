"""Planners by swarm optimisers: encoding, cost, scene, repair, and ants; the entry of all but `aco` is `planner`."""
