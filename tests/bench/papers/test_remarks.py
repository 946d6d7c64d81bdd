"""What is said of the printed tables follows from their own numbers."""

from __future__ import annotations

from gcsplan.bench.papers.printed import PRINTED
from gcsplan.bench.papers.remarks import remarks, schedules
from gcsplan.bench.papers.scenarios import mission_text, prepare
from gcsplan.bench.papers.statistics import row
from tests.bench.papers.made import record


def test_what_is_said_of_the_tables_is_worked_out_from_them() -> None:
    krill = " ".join(remarks("krill-forest"))
    assert "5 are 14.32 J/m" in krill
    assert "1.0 % against abc" in krill
    assert "2.1 % against aco" in krill
    msfoa = [" ".join(remarks(f"msfoa-{i}")) for i in (1, 2, 3)]
    assert "abc 411.17 < msfoa 416.96 < mfoa 417.06" in msfoa[0]
    assert "mfoa 388.33 < abc 401.01 < msfoa 404.21" in msfoa[1]
    assert "msfoa 454.52 < abc 457.46" in msfoa[2]
    assert "rows of foa and pso are identical" in msfoa[1]
    assert "identical" not in msfoa[0] + msfoa[2]


def test_printed_times_that_stand_in_the_wrong_column_are_marked() -> None:
    name = "ib-abc-sequence"
    rows = [row(name, a, [record(a, 0, 1000.0, lengths_m=[250.0] * 4)], 0) for a in ("ib-abc", "b-abc", "abc")]
    summary = {"paper": "ib-abc", "set": prepare(name, mission_text(name)), "rows": rows,
               "printed": {a: PRINTED[name, a] for a in ("ib-abc", "b-abc", "abc")}}  # fmt: skip
    header, cells = schedules(summary)
    at = header.index("printed T, s")
    marked = {(c[0], c[1]) for c in cells if "≠" in c[at]}
    right = {("ib-abc", "uav1"), ("b-abc", "uav1"), ("abc", "uav1"), ("ib-abc", "uav4")}
    assert marked == {(a, f"uav{i}") for a in ("ib-abc", "b-abc", "abc") for i in (1, 2, 3, 4)} - right
