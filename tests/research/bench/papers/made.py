"""Runs that are made, and the scenario of the tests that make them."""

from __future__ import annotations

from typing import Any

SCENARIO = "ssgwo-table7-tall"
PAIR = ("ssgwo", "gwo")


def record(name: str, number: int, length: float, violations: int = 0, **more: Any) -> dict[str, Any]:
    return {
        "scenario": SCENARIO, "algorithm": name, "seed": 1, "number": number, "digest": "x", "status": "found",
        "length_m": length, "lengths_m": [length], "cost": length + 100.0 * violations, "energy_j": 100.0 * length,
        "violations": violations, "collisions": violations, "time_s": 1.0, "evaluations": 10, "iterations": 9,
        "converged": 5, "pitch_deg": 1.0, "yaw_deg": 2.0, "nearest_m": None,
        "history": {"iterations": [0, 9], "evaluations": [5, 10], "cost": [None, length]}, "paths": [],
    } | more  # fmt: skip


def same_numbers(result: dict[str, Any]) -> list[dict[str, Any]]:
    rows = [r for s in result["scenarios"] for r in s["rows"]]
    return [{k: v for k, v in r.items() if "time_s" not in k} for r in rows]
