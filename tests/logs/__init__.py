"""Tests of flight logs."""
