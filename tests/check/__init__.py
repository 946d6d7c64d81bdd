"""Tests of the verdict on a mission."""
