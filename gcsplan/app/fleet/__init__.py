"""From a mission file to the plan of all its vehicles, and why there is none."""
