"""Tests of benchmarks of optimisers and swarm planners."""
