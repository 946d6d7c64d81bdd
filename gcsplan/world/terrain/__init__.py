"""Terrain models: files read, joined and cut to a grid, their unknown parts, and the part that a vehicle stores."""
