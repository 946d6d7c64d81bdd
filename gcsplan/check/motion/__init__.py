"""What an aircraft does between items: stretches, turns and returns of each autopilot, in numbers."""
