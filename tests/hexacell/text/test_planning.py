"""Text for the plan: what to do now, what the remaining records gain, what the plan will give."""

import json
from dataclasses import replace

import pytest

from hexacell.campaign.decisions import Forecast
from hexacell.cell.bundled import bundled_config
from hexacell.cli.app import main
from hexacell.dry_run.campaign import DryRunResult
from hexacell.errors import ExitCode
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet
from hexacell.services.offline import PlanTrial
from hexacell.text.planning import forecast_text, plan_trial_lines, run_forecast_line


def test_errors_of_micrometres_are_in_um():
    precise = Forecast(now_mm=0.0123, next_mm=0.004, end_mm=0.0009, records=24, minutes=12.4)
    text = forecast_text(precise.model_copy(update={"systematic_mm": 0.0005}))
    assert "0.012 mm (one sigma), U 0.025 mm with" in text
    assert "U 2.06 um then in 24 records" in text
    assert run_forecast_line(precise) == "  predicted error at the task 4.00 um; in 12 minutes 0.90"


def lines(target_mm=None, **changes):
    values = {
        "drawn": 3,
        "robots": 2,
        "points": 5,
        "records": 55,
        "outside": 0,
        "worst_sigma_mm": 0.0214,
        "minutes": 40.2,
    }
    return [
        *plan_trial_lines(PlanTrial(DryRunResult(**(values | changes)), {1: 0.0, 2: 0.0625}, target_mm))
    ]


def test_what_a_plan_may_miss_is_reported():
    assert "U of the largest error there will be about 0.066 mm" in lines(expanded_mm=0.0661)[1]
    assert any("not the target of 0.02 mm" in line for line in lines(target_mm=0.02))
    assert not any("target" in line for line in lines(target_mm=0.05))
    assert "1 of 3 simulated robots could not be calibrated with this plan." in lines()
    assert lines(robots=0, drawn=6)[0].startswith("None of 6 robots drawn within the tolerances")
    assert "no accuracy is predicted" in lines(worst_sigma_mm=None)[0]


@pytest.fixture
def propose(tmp_path, capsys):
    """``hexacell next`` for some records."""

    def run(measurements, *options):
        file = tmp_path / "measured.csv"
        write_measurements(file, measurements)
        cell = str(bundled_config("simulated-hexaglide"))
        assert main(["next", cell, "--measurements", str(file), *options]) == ExitCode.DONE
        return capsys.readouterr().out

    return run


def test_next_says_which_records_it_leaves_out(propose, noisy):
    wrong = noisy.records[17]
    x, y, z = wrong.deviation
    false = replace(wrong, deviation=(x, y, z + 1.0))
    spoilt = MeasurementSet(tuple(false if one is wrong else one for one in noisy.records))
    sentence = "Left out, as the other records contradict them: point 2, orientation 7."
    assert sentence in " ".join(propose(spoilt).split())
    assert json.loads(propose(spoilt, "--json"))["left_out"] == [[2, 7]]
    assert "Left out" not in propose(noisy)
    assert json.loads(propose(noisy, "--json"))["left_out"] == []
