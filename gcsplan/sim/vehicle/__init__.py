"""The simulated vehicle: its side of the protocol, what it stores, what it sends, and the server in front of it."""
