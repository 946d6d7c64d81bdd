"""Degrees and metres: frames, datums, units of height, grids, shapes drawn in degrees."""
