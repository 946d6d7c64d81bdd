"""Names, units and values of the return altitude."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission.return_parameters import on_board, setting, settings
from gcsplan.vehicle import Autopilot

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4


@pytest.mark.parametrize(
    ("autopilot", "words"),
    [
        (COPTER, "RTL_ALT 35300 (cm) or, since ArduPilot 4.7, RTL_ALT_M 353 (m)"),
        (PLANE, "RTL_ALTITUDE 353 (m) or, before ArduPilot 4.5, ALT_HOLD_RTL 35300 (cm)"),
        (PX4, "RTL_RETURN_ALT 353 (m)"),
    ],
)
def test_without_a_version_every_name_is_told_with_its_own_value(autopilot: Autopilot, words: str) -> None:
    assert setting(autopilot, 353.0) == words


@pytest.mark.parametrize(("metres", "centimetres"), [(352.3, 35230), (352.301, 35231), (0.1 + 0.2, 30), (15.0, 1500)])
def test_a_value_is_rounded_up_to_a_centimetre_and_never_down(metres: float, centimetres: int) -> None:
    by_name = {s["parameter"]: s["value"] for s in settings(COPTER, metres)}
    assert by_name == {"RTL_ALT": centimetres, "RTL_ALT_M": centimetres / 100}


def test_the_name_that_a_vehicle_answers_to_tells_its_version() -> None:
    for name, unit in (("RTL_ALT", "cm"), ("RTL_ALT_M", "m"), ("ALT_HOLD_RTL", "cm"), ("RTL_RETURN_ALT", "m")):
        parameter = on_board({name: 1.0, "FENCE_ENABLE": 0.0})
        assert parameter is not None
        assert (parameter.name, parameter.unit) == (name, unit)
    assert on_board({"FENCE_ENABLE": 0.0}) is None
