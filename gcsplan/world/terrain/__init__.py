"""Terrain models: files read, joined and cut to a grid, what is unknown in them, and what a vehicle stores of them."""
