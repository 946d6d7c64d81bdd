"""Tests of swarm planners and the papers they come from."""
