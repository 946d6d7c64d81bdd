"""Sessions with vehicles: find one, look at its state and parameters, send, read back, judge again."""
