"""Tests of the simulated flight."""
