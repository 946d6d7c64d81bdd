"""Tests of terrain, zones, the exact check of legs."""
