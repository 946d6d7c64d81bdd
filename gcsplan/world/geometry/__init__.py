"""Surfaces, zones, limits and paths in metres."""
