"""The planner `optimal`: paths below altitude caps, and a bound that no path can beat; its entry point is `planner`."""
