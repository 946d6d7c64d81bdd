"""Tests of mission files of ground stations."""
