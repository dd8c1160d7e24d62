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
from hexacell.noise.measured_noise import AveragingForecast
from hexacell.services.offline import PlanTrial
from hexacell.text.planning import forecast_text, plan_trial_lines, run_forecast_line

FORECAST = Forecast(now_mm=0.31, next_mm=0.29, end_mm=0.06, records=24, minutes=12.4)


def test_a_forecast_says_what_records_gain_and_u_where_the_effects_are_known():
    text = forecast_text(FORECAST)
    assert text.startswith("Predicted error at the worst task pose 0.310 mm (one sigma);")
    assert text.endswith("continuing gains 0.250 mm in 24 records, about 12 minutes.")
    done = FORECAST.model_copy(update={"now_mm": 0.06, "records": 0})
    assert forecast_text(done).endswith("0.060 mm (one sigma).")
    assert "none of the task poses" in forecast_text(None)
    known = FORECAST.model_copy(update={"systematic_mm": 0.08})
    assert known.expanded_mm(0.06) == pytest.approx(0.2)
    assert FORECAST.expanded_mm(0.06) is None
    text = forecast_text(known)
    assert "0.310 mm (one sigma), U 0.640 mm with the systematic effects;" in text
    assert text.endswith("continuing gains 0.250 mm, U 0.200 mm then in 24 records, about 12 minutes.")


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


def test_the_part_of_the_encoders_is_told():
    forecasts = tuple(
        AveragingForecast(windows=windows, error_mm=0.2 / windows**0.5, minutes=0.5 * windows)
        for windows in (1, 2, 4)
    )
    trial = PlanTrial(DryRunResult(2, 2, 5, 55, 0, 0.02, 40.0), {}, None, forecasts, 0.17)
    assert [*plan_trial_lines(trial)][-1] == (
        "The noise of the encoders makes about 0.170 of 0.200 mm (one sigma). As far as noise differs "
        "from reading to reading, which a run measures, 4 windows of readings a record give 0.100 mm for "
        "2 minutes more."
    )


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


def test_next_says_which_records_it_leaves_out(propose, visit):
    measured = visit(seed=2).measured(0.01, seed=1)
    wrong = measured.records[17]
    x, y, z = wrong.deviation
    records = [
        replace(wrong, deviation=(x, y, z + 1.0)) if one is wrong else one for one in measured.records
    ]
    spoilt = MeasurementSet(tuple(records))
    sentence = "Left out, as the other records contradict them: point 2, orientation 7."
    assert sentence in " ".join(propose(spoilt).split())
    assert json.loads(propose(spoilt, "--json"))["left_out"] == [[2, 7]]
    assert "Left out" not in propose(measured)
    assert json.loads(propose(measured, "--json"))["left_out"] == []
