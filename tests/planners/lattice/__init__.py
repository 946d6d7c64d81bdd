"""Tests of the search over reachable altitudes."""
