"""The searches of the default planner: one a module, named like it."""
