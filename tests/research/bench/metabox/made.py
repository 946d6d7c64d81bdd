"""The few runs that the tests of the benchmark beside MetaEvoBox make."""

from __future__ import annotations

FEW = {"instances": 2, "runs": 2, "evaluations": 100, "algorithms": ("gwo", "Random_search", "DE")}
