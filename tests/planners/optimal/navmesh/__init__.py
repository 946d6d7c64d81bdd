"""Tests of outlines, meshes and shortest tracks over them."""
