"""Runs are broken at every kind of step, and at the instants that are meant."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from procedures.steps import events
from procedures.steps.base import StepWithoutMotion
from procedures.steps.registry import STEPS as STEPS_OF_RUNS
from tests.faults.killing import KILLED
from tests.faults.steps import STEPS, step_of
from tests.faults.test_killed import killed

WITHOUT_MOTION: list[Any] = [step for step in STEPS_OF_RUNS if issubclass(step, StepWithoutMotion)]


@pytest.mark.parametrize("step", WITHOUT_MOTION)
def test_every_computation_is_a_step_of_the_matrix(step: Any) -> None:
    assert step_of([events.StepBegun(step=step())]) in STEPS


def test_a_run_that_ended_before_the_kill_is_tried_again_earlier() -> None:
    codes, instants = [0, 0, KILLED], []

    def program(_: object, die_after_s: float) -> SimpleNamespace:
        instants.append(die_after_s)
        return SimpleNamespace(code=codes.pop(0), words="", seconds=4.0)

    _, duration_s = killed(SimpleNamespace(run=program), lambda: "site", 0.5, 10.0)
    assert not codes
    assert instants == sorted(instants, reverse=True)
    assert instants[-1] == pytest.approx(0.5 * duration_s)
    assert duration_s < 4.0
