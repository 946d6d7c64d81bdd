"""Tests of terrain from published sources: the download, the cache, and the ground that comes out of it."""
