"""Independent implementations that clever code is held to."""
