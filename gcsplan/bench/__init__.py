"""Benchmarks. Each prints what it measured, and a ratio, because machines are noisy."""
