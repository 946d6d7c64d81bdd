"""Tests of from paths to mission items."""
