"""Tests of the default planner."""
