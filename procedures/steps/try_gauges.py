"""Try: back at a set's reference it is judged whether each gauge followed the ball."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from hexacell.cell.devices import GaugeSettings
from hexacell.errors import joined
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import deviation_of
from hexacell.noise.allowances import Allowances
from hexacell.noise.gauge_trial import GaugeMistake, GaugeTrial
from procedures.resources.run_resources import RunResources
from procedures.run.keys import ThreeNumbers
from procedures.run.set_state import SetState
from procedures.run.state import RunState
from procedures.steps.base import EventOfSet, StepOfSet
from procedures.steps.place import MountingError

MISTAKES: Mapping[GaugeMistake, tuple[str, str, str]] = {
    GaugeMistake.DEAD: (
        "does not follow the ball",
        "do not follow the ball",
        "See whether the plunger touches the ball and is free, and the display changes in millimetres",
    ),
    GaugeMistake.INCHES: (
        "seems to answer in inches",
        "seem to answer in inches",
        "Press the in/mm key; if it answers in mm, see whether its plunger is free",
    ),
    GaugeMistake.MICROMETRES: (
        "seems to answer in micrometres",
        "seem to answer in micrometres",
        "Set it to millimetres, or correct mm_per_unit in the cell file and begin a new run",
    ),
    GaugeMistake.EXCHANGED: (
        "answers on another axis",
        "are exchanged",
        "Exchange their cables, or correct port, channel or axis in the cell file and begin a new run",
    ),
    GaugeMistake.REVERSED: (
        "counts the wrong way",
        "count the wrong way",
        "Change the counting direction, or correct sign in the cell file and begin a new run",
    ),
}
"""What each mistake of one gauge and of several is called, and what to do."""


class GaugesTried(EventOfSet):
    """The gauges of a set follow the ball, each on its axis, with its sign and scale.

    ``response`` is what the gauges x, y, z showed per length of a move along x, y, z.
    """

    kind: Literal["tried"] = "tried"
    response: tuple[ThreeNumbers, ThreeNumbers, ThreeNumbers]

    def applied_to(self, state: RunState) -> RunState:
        """The gauges need no other trial until they are unwatched or placed by a person."""
        tried = replace(state, gauges_tried=True)
        return tried.with_changed_set(self.at, tried=True, has_left=False)


class Try(StepOfSet):
    """Back at a set's reference: judge whether the gauges followed the ball."""

    kind: Literal["try"] = "try"

    outcomes: ClassVar = (GaugesTried,)
    purpose: ClassVar[str] = "trying the gauges"

    async def perform(self, run: RunResources, state: RunState) -> GaugesTried:
        """Compare the probes with the reference; raises ``MountingError`` where a gauge did not follow."""
        trial = trial_of(run.calibration.known(state).allowances, state.set(self.at))
        if trial.findings:
            gauges = sorted(run.settings.gauges, key=lambda gauge: gauge.axis)
            errors = [_mistake(*found, gauges, trial.response) for found in trial.findings.items()]
            raise joined("the gauges do not answer as they are mounted by the cell file", errors)
        x, y, z = (deviation_of(row) for row in trial.response)
        return GaugesTried(at=self.at, response=(x, y, z))


def trial_of(allowances: Allowances, measured: SetState) -> GaugeTrial:
    """What the gauges of a set showed beside its reference, and how far the ball went by the encoders."""
    zero = measured.samples[0]
    before = np.array(zero.reading.gauges_mm), np.array(zero.reading.joints)
    shown = np.array([probe.reading.gauges_mm for probe in measured.probes]) - before[0]
    joints = np.array([probe.reading.joints for probe in measured.probes]) - before[1]
    return GaugeTrial(allowances.ball_at(Pose(*zero.pose)).motion(joints), shown)


def _mistake(
    mistake: GaugeMistake, concerned: Sequence[int], gauges: Sequence[GaugeSettings], response: Array
) -> MountingError:
    """What is wrong with some gauges, what they showed, and what to do."""
    named = [gauges[number] for number in concerned]
    of_one, of_several, action = MISTAKES[mistake]
    problem = of_several if len(named) > 1 else of_one
    shown = "; ".join(
        f"{gauges[n].name} showed {', '.join(f'{value:+.3f}' for value in response[n])}" for n in concerned
    )
    return MountingError(
        f"{problem}: while the ball moved by 1 mm along x, y and z in turn, {shown} mm",
        subject=f"gauge{'s' if len(named) > 1 else ''} {', '.join(gauge.name for gauge in named)}",
        action=action,
    )
