"""Tests of the mission file."""
