"""The benchmarks of uploads: what they refuse, send and report; not how fast."""

from __future__ import annotations

import pytest

from gcsplan.bench import upload
from gcsplan.errors import InputError


def test_a_fleet_of_one_is_refused_and_the_report_of_one_tells_ratio_and_loss() -> None:
    with pytest.raises(InputError, match="2 to 254 vehicles"):
        upload.run_fleet(fleet=1)
    told = upload.report_fleet(
        {
            "vehicles": 20, "items": 50, "drop": 0.05, "autopilot": "px4", "together_s": 9.0, "slowest_alone_s": 8.0,
            "slowest_sysid": 7, "ratio": 1.125, "retries": 3,
        }
    )  # fmt: skip
    assert "1.125" in told
    assert "5 %" in told


def test_a_mission_has_as_many_way_points_as_asked_no_two_alike() -> None:
    items = upload.items_of(600)
    assert len({(item.x, item.y) for item in items}) == len(items) == 600
    assert all(60.0 <= item.z < 100.0 for item in items)
    assert upload.items_of(7) == items[:7]


@pytest.mark.parametrize("asked", [{"items": 0}, {"items": 2001}, {"runs": 0}, {"runs": 101}])
def test_uploads_that_would_measure_nothing_are_refused(asked: dict[str, int]) -> None:
    pytest.importorskip("mavsdk")
    with pytest.raises(InputError, match="1 to 2000 items and 1 to 100 runs, not"):
        upload.run(**asked)


def test_without_mavsdk_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(upload, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'gcsplan\[test\]'"):
        upload.run()


def test_the_report_tells_both_times_and_their_ratio() -> None:
    told = upload.report(
        {
            "items": 600, "runs": 15, "gcsplan_s": 0.125, "gcsplan_verified_s": 0.25, "mavsdk_s": 0.5, "ratio": 0.25,
            "ratio_least": 0.2, "ratio_most": 0.3,
        }
    )  # fmt: skip
    assert [line.split()[-2] for line in told.splitlines()[1:4]] == ["0.125", "0.250", "0.500"]
    assert "0.25   (0.20 … 0.30 pair by pair)" in told
