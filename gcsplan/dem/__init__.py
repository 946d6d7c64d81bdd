"""Terrain from published sources: their table, the cache of tiles, and the download that fills it."""

DEFAULT_SOURCE = "copernicus-glo30"
"""The source that is fetched where none is named."""
