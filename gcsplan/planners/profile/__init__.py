"""Altitude over a fixed track: tubes, the taut string, laps, way points under the exact check."""
