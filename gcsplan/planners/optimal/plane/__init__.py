"""What the searches share: legs in the plane under a cap, the best path and bound so far."""
