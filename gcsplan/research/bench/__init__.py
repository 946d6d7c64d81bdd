"""Benchmarks of optimisers and swarm planners: the papers' tables, functions, MetaEvoBox's problems, real terrain."""
