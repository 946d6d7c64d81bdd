"""Flight logs: position and battery power over time, and the energy model that fits them."""
