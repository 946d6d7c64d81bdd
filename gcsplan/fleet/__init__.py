"""Fleet planning: motion in time, arrival schedules, separation of every pair. Metres and seconds, no degrees."""
