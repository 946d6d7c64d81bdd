"""The way home: the autopilot's own return after a failsafe, judged from every point of a mission."""
