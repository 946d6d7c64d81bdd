"""Benchmarks. Each prints its measurements, and a ratio, because machines are noisy."""
