"""Tests of optimisers on the unit box."""
