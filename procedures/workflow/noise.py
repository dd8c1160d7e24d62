"""The steps that measure the noise, at the first reference: read at rest, leave and come back.

As long as little is known of the robot it leaves for pilot poses, which steer the choice of the others
(:mod:`hexacell.campaign.pilots`), and else for level ones beside the reference.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.campaign.planner import Plan
from hexacell.cell.measuring import NoiseSettings
from hexacell.kinematics.pose import Pose
from hexacell.motion.path_check import is_clear
from hexacell.noise.noise_assessment import visits_agree
from procedures.calibration.calibration import campaign_state
from procedures.run.keys import SetKey, SixNumbers
from procedures.run.state import RunState
from procedures.steps.assess_noise import AssessNoise, noise_readings
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.registry import Step
from procedures.steps.repeat import Repeat
from procedures.steps.standstill import Standstill
from procedures.workflow.sets import Known, SetSteps, move_to_chosen, reference_pose

DISTANCE_SHARE = 0.3
"""How far the robot leaves the reference, level as it is, as a share of the gauges' travel."""


@dataclass(frozen=True, eq=False)
class NoiseSteps:
    """Decides on the steps of the sets of a plan's robot."""

    plan: Plan
    sets: SetSteps

    @property
    def settings(self) -> NoiseSettings:
        """What is to be measured."""
        return self.plan.settings.noise

    def next_step(self, state: RunState, key: SetKey, known: Known | None) -> Step | None:
        """The next step at the open set; None if the noise is measured, or not to be.

        ``known`` is the robot, and where the ball was when the gauges were zeroed, if that is known.
        """
        measured = state.set(key)
        is_asked = self.settings.standstill_readings or self.settings.revisits
        if state.noise is not None or not is_asked or len(measured.samples) != 1:
            return None
        if state.at_pose != (key, 1):
            return self._away(state, key) or self.sets.way_back(state, key, known)
        if measured.has_left:
            return Repeat(at=key)
        if self.settings.standstill_readings and measured.standstill is None:
            return Standstill(at=key)
        return self._leave(state, key, known) or AssessNoise()

    def _away(self, state: RunState, key: SetKey) -> Step | None:
        """What is left to do before the robot returns to the reference; None if nothing is."""
        measured = state.set(key)
        if measured.piloted == self.plan.pilots_per_departure or not measured.has_left:
            return None
        orientation = FIRST_PILOT + len(measured.pilots)
        if state.at_pose == (key, orientation) and state.target is not None:
            return Pilot(at=key, orientation=orientation, pose=state.target)
        return self._to_pilot(state, key)

    def _to_pilot(self, state: RunState, key: SetKey) -> Move | None:
        """The next move to the next pilot pose; None if there is none, or the visits do not repeat.

        A robot that shows other places each time it is at one is not known by what it shows.
        """
        visits = noise_readings(state.set(key), self.plan.settings.encoders)
        if not visits_agree(self.plan.cautious, visits):
            return None
        pilot = self.plan.pilot_pose(campaign_state(state, key))
        return None if pilot is None else move_to_chosen(state, pilot)

    def _leave(self, state: RunState, key: SetKey, known: Known | None) -> Move | None:
        """The move away from the reference before its next visit; None after the last one."""
        done = len(state.set(key).visits)
        if done >= self.settings.revisits:
            return None
        if pilot := self._to_pilot(state, key):
            return pilot
        reference = reference_pose(state, key)
        beside = [pose for pose in self._beside(reference) if self._is_clear(state, key, pose, known)]
        if not beside:
            return None
        return Move(at=key, orientation=0, pose=beside[done % len(beside)])

    def _beside(self, reference: SixNumbers) -> Iterable[SixNumbers]:
        """Poses on all sides of the reference, each followed by the opposite one."""
        x, y, z, a, b, c = reference
        distance = DISTANCE_SHARE * self.sets.robot.limits.room.smallest_mm
        for dx, dy, dz in distance * np.concatenate([[row, -row] for row in np.eye(3)]):
            yield (x + float(dx), y + float(dy), z + float(dz), a, b, c)

    def _is_clear(self, state: RunState, key: SetKey, pose: SixNumbers, known: Known | None) -> bool:
        """Whether the robot as it is known by now gets there and back within the limits."""
        reference = reference_pose(state, key)
        here, there = (self.sets.robot.from_commands([Pose(*one)]) for one in (reference, pose))
        drawn = self.sets.robot.belief().zeroed_at(state.zero_shown(key))
        belief, ball = (drawn, None) if known is None else (known[0], known[1].reference)
        return is_clear(belief, here, there, ball) and is_clear(belief, there, here, ball)
