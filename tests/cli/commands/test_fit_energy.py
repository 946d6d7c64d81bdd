"""`gcsplan fit-energy`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from gcsplan.cli.commands.fit_energy import fit_energy as command
from gcsplan.errors import UsageError
from tests.support.flight_logs import R1, R2, csv_of, flown


def run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=True)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


def test_the_command_prints_what_is_to_be_pasted(tmp_path: Path) -> None:
    t, place, watts = flown(seed=12)
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,P", [t, *place.T, watts])
    code, text = run(str(file), "--csv-columns", "power_w=P")
    assert code == 0
    numbers = yaml.safe_load(text)["energy"]
    assert set(numbers) == {"vertical_j_per_m", "horizontal_j_per_m", "hover_w", "fitted_speed_m_s"}
    assert numbers["vertical_j_per_m"] == pytest.approx(R1, rel=0.02)
    with pytest.raises(UsageError, match="time_s=Time"):
        run(str(file), "--csv-columns", "power")


def test_the_command_ends_with_4_where_the_log_cannot_tell(tmp_path: Path) -> None:
    t, place, watts = flown([(0, 0, 10, 5), (3000, 0, 0, 300)])
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,power", [t, *place.T, watts])
    code, text = run(str(file), "--json")
    told = json.loads(text)
    assert code == 4
    assert told["error"]["code"] == 4
    assert "vertical_j_per_m" in told["error"]["message"]
    assert told["fit"]["vertical_j_per_m"]["value"] is None
    assert told["fit"]["horizontal_j_per_m"]["value"] == pytest.approx(R2, rel=0.02)
