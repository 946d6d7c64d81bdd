"""The way home after a failsafe: the autopilot's own return, judged from every point of a mission."""
