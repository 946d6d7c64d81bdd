"""The table of swarms counts what was measured."""

from __future__ import annotations

from gcsplan.bench.swarms.report import Attempt, Method, Optimum, SwarmsResult


def attempts() -> list[Attempt]:
    method = Method("gcsplan", "de")
    told = [("raw legal", 102.0, 1), ("repaired", 101.0, 1), ("repaired", 210.0, 1), ("refused", None, 3),
            ("refused", None, None)]  # fmt: skip
    return [
        Attempt(f"m{k}", "room", method, status, length, 10, 0.1 * k, 0.5, searches)  # type: ignore[arg-type]
        for k, (status, length, searches) in enumerate(told)
    ]


def test_the_table_tells_raw_legal_repaired_and_refused_apart() -> None:
    optima = {f"m{k}": Optimum(100.0 if k < 2 else 200.0, 99.0, 0.1) for k in range(5)}
    [line] = SwarmsResult(1, 10, optima, attempts(), [(0, 0)]).lines()
    assert line[:8] == ("de", "offsets", "length", "1", "2", "2", "60", "80")
    assert line[8:] == ("2.00", "4.40", "5.00", "2.00", "3.00", "0.20", "0.50")
