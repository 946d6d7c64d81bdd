"""A mission of several vehicles on the map: who flies, when, and where in space."""
