"""Terrain from published sources: their table, the cache of tiles, and the download that fills it."""
