"""The world in metres: frame, terrain, zones, limits, paths, and the exact check of legs."""
