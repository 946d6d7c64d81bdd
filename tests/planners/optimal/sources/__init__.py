"""Tests of sources of paths."""
