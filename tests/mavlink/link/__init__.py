"""Tests of links, sessions and uploads."""
