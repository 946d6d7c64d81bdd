"""Tests of motion in time, arrival and separation."""
