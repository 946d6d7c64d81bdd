"""When: motion in time, arrival schedules, and the separation of every pair. Metres and seconds; no degrees."""
