"""The motion of an aircraft between items: stretches, turns and returns of each autopilot, in numbers."""
