"""Tests of the way home."""
