"""The plan in words: what to do now, what going on would gain, what the plan will give."""

from __future__ import annotations

import pytest

from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.campaign.dry_run import DryRunResult
from hexacell.cli.progress import doing, forecast_line
from hexacell.kinematics.pose import Pose
from hexacell.presentation.planning import foretold_words, minutes_words, outlook_words, visit_words
from procedures.run import events
from procedures.run.steps import Expectation, Move, Phase, RunForecast, SetKey

ZERO = (0.0,) * 6
OUTLOOK = Forecast(now_mm=0.31, next_mm=0.29, end_mm=0.06, records=24, minutes=12.4)
FORECAST = RunForecast(now_mm=0.31, next_mm=0.29, end_mm=0.06, records=24, minutes=12.4)


def test_what_to_do_now():
    assert visit_words(Finished("all 5 points are measured")) == "Done: all 5 points are measured."
    opening = visit_words(StartPoint(2, Pose(0.0, -200.0, 550.0), ZERO))
    assert opening.startswith("Begin point 2: go to X0.000 Y-200.000 Z550.000 A0.000")
    visit = MeasurePose(2, 7, Pose(1.0, 2.0, 3.0), ZERO, (0.1, -0.2, 0.0), (0.5, 0.6, 0.7), 1.8, None)
    assert visit_words(visit).startswith("Point 2, orientation 7: go to X1.000 Y2.000 Z3.000")
    assert "x +0.100 +- 0.500, y -0.200 +- 0.600, z +0.000 +- 0.700 mm" in visit_words(visit)


def test_what_going_on_would_gain():
    words = outlook_words(OUTLOOK)
    assert "0.310 mm (one sigma, the worst)" in words
    assert words.endswith("going on gains 0.250 mm in 24 records, about 12 minutes.")
    assert outlook_words(Forecast(0.06, 0.06, 0.06, 0, 0.0)).endswith("(one sigma, the worst).")
    assert "none of the task poses" in outlook_words(None)


@pytest.mark.parametrize(
    ("minutes", "words"),
    [(0.4, "24 seconds"), (1.4, "84 seconds"), (1.6, "2 minutes"), (61.2, "61 minutes")],
)
def test_durations_are_no_more_exact_than_known(minutes, words):
    assert minutes_words(minutes) == words


def test_a_runs_progress_always_says_what_going_on_gains():
    key = SetKey(phase=Phase.IDENTIFY, point=2)
    zero = (0.0, 0.0, 0.0)
    expected = Expectation(deviation_mm=zero, sigma_mm=zero, gain=1.0, forecast=FORECAST)
    chosen = Move(at=key, orientation=7, pose=ZERO, expected=expected)
    assert doing(events.StepBegun(step=chosen)) == "point 2, orientation 7: 0.310 -> 0.060 mm"
    assert doing(events.StepBegun(step=Move(at=key, orientation=1, pose=ZERO))) == "point 2, orientation 1"
    line = forecast_line(FORECAST)
    assert line == "  predicted error at the task 0.290 mm; going on gains 0.230 mm in 12 minutes"
    last = FORECAST.model_copy(update={"records": 1})
    assert forecast_line(last) == "  predicted error at the task 0.290 mm"


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
    return [*foretold_words(DryRunResult(**(values | changes)), {1: 0.0, 2: 0.0625}, target_mm=target_mm)]


def test_what_the_plan_will_give():
    first, *rest = lines(drawn=2)
    assert first == (
        "55 records at 5 points will give about 0.021 mm at the worst of your task poses (one sigma), "
        "in about 40 minutes."
    )
    assert len(rest) == 1
    assert rest[0].startswith("Point 2: 6% of the robots within the tolerances cannot stand there")


def test_a_target_that_will_not_be_reached_is_said():
    assert any("not the target of 0.02 mm" in line for line in lines(target_mm=0.02))
    assert not any("target" in line for line in lines(target_mm=0.05))


def test_a_plan_that_hardly_any_robot_survives_is_said():
    assert "1 of 3 simulated robots could not be calibrated like this." in lines()
    assert lines(robots=0, drawn=6)[0].startswith("None of 6 robots drawn within the tolerances")
    assert "no accuracy is predicted" in lines(worst_sigma_mm=None)[0]
