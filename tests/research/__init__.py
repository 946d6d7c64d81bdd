"""Tests of swarm planners, optimisers and the benches of the papers."""
