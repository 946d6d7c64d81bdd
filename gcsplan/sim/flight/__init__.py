"""The simulated flight: a stored mission as a track, flown in simulated time, and what was flown."""
