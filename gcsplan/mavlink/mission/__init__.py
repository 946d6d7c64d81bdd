"""A mission as it is stored: its items, how each autopilot stores them, and how two missions are compared."""
