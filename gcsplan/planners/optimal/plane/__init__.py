"""The shared state of the searches: legs in the plane under a cap, the best path and bound so far."""
