"""Text of plans and forecasts: what to do now, what records gain, what limits and the length check say."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.decisions import Forecast
from hexacell.campaign.time_model import TimeKind
from hexacell.cell.bundled import bundled_config
from hexacell.cell.measuring import AcceptanceSettings
from hexacell.cli.app import main
from hexacell.dry_run.campaign import DryRunResult
from hexacell.dry_run.verdict_forecast import NOISE, VerdictForecast
from hexacell.errors import ExitCode
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet
from hexacell.results.result import LengthResult
from hexacell.services.offline import PlanTrial
from hexacell.text.planning import (
    forecast_text,
    plan_trial_lines,
    run_forecast_line,
    verdict_forecast_lines,
)
from hexacell.text.verdict import earlier_scale_line, not_checked, scale_lines
from hexacell.verdict.decision import Verdict


def test_errors_of_micrometres_are_in_um():
    precise = Forecast(now_mm=0.0123, next_mm=0.004, end_mm=0.0009, records=24, minutes=12.4)
    text = forecast_text(precise.model_copy(update={"systematic_mm": 0.0005}))
    assert "0.012 mm (one sigma), U 0.025 mm with" in text
    assert "U 2.06 um then in 24 records" in text
    assert run_forecast_line(precise) == "  predicted error at the task 4.00 um; in 12 minutes 0.90"


def lines(target_mm=None, **changes):
    values: dict[str, Any] = {
        "drawn": 3,
        "robots": 2,
        "points": 5,
        "records": 55,
        "outside": 0,
        "worst_sigma_mm": 0.0214,
        "seconds": {TimeKind.MOVING: 2000.0, TimeKind.READING: 412.0, TimeKind.ASKING: 0.0},
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


NONE = dict.fromkeys(Verdict, 0.0)


def forecast(passed: float, part: str = NOISE, *, position: float = 0.2, orientation: float = 0.01):
    probabilities = NONE | {Verdict.PASS: passed, Verdict.CONDITIONAL_PASS: 1.0 - passed}
    passing = AcceptanceSettings(position_mm=position, orientation_deg=orientation)
    limits = AcceptanceSettings(position_mm=0.15, orientation_deg=0.05)
    return VerdictForecast(probabilities, limits, passing, part, 0.064, 0.072)


def test_limits_that_good_machines_fail_are_warned_of_with_what_would_do_or_how_many_records() -> None:
    first, warning = verdict_forecast_lines(forecast(0.62, "scale of each encoder", position=0.2031), 55)
    assert "probability of 62% (conditional pass 38%)" in first
    assert "95% would pass position_mm = 0.21 in [acceptance]. The largest part" in warning
    assert "is the scale of each encoder (0.064 of 0.072 mm): have it calibrated" in warning
    for position, orientation, said in (
        (0.1, 0.0612, "would pass orientation_deg = 0.062 in"),
        (0.2, 0.06, "would pass position_mm = 0.2 and orientation_deg = 0.06 in"),
        (0.1, 0.01, "would pass the limits in"),
    ):
        _, warning = verdict_forecast_lines(forecast(0.5, position=position, orientation=orientation), 55)
        assert said in warning
    _, warning = verdict_forecast_lines(forecast(0.5), 55)
    assert "about 124 records instead of 55" in warning
    # The part of the noise falls with the root of their number, what it is compared with does not.
    expected = np.hypot(0.064 * (55 / 124) ** 0.5, 0.033)
    assert expected == pytest.approx(0.15 / 0.2 * 0.072, rel=0.02)


def length_of(long_um_m: float = 12.0, reason: str = "") -> LengthResult:
    return LengthResult(
        distance_mm=300.0,
        length_mm=300.0036,
        long_um_m=long_um_m,
        expanded_um_m=20.0,
        stated_um_m=15.0,
        sources=(),
        is_consistent=not reason,
        reason=reason,
    )


@pytest.mark.parametrize(
    ("sign", "direction", "factor"), [(1, "long", "0.999001"), (-1, "short", "1.001001")]
)
def test_a_scale_is_one_line_and_a_significant_one_has_its_remedy(sign, direction, factor) -> None:
    said = f"encoders read 12 +- 20 um/m {direction}"
    assert scale_lines(length_of(sign * 12.0)) == [f"length scale: checked over 300.000 mm: {said}"]
    assert earlier_scale_line(length_of(sign * 12.0)).endswith(f"as checked in that run: {said}")
    remedy = " ".join(" ".join(scale_lines(length_of(sign * 1000.0))).split())
    assert f"multiply the scale factor of all encoders by {factor}, at the drives" in remedy


def test_what_was_not_checked_is_said_and_what_says_nothing_is_left_out() -> None:
    assert scale_lines(None) == [not_checked()] == [earlier_scale_line(None)]
    assert scale_lines(length_of(reason="the fixture moved")) == []
    assert earlier_scale_line(length_of(reason="the fixture moved")) == not_checked()
