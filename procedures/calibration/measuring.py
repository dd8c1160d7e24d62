"""What is measured while one geometry commands the robot: the plan of it, and the steps of each kind."""

from __future__ import annotations

from hexacell.campaign.planner import Plan
from procedures.calibration.held_out_poses import HeldOutPoses
from procedures.calibration.held_out_steps import HeldOutSteps
from procedures.calibration.identification_steps import IdentificationSteps
from procedures.calibration.length_steps import LengthSteps
from procedures.calibration.noise_steps import NoiseSteps
from procedures.calibration.set_steps import SetSteps
from procedures.calibration.trial_steps import TrialSteps


class Measuring:
    """What is measured, for the geometries that command the robot of a plan.

    Attributes:
        points: the steps of the identification, or of a check.
        held_out_poses: chooses the poses of ``held_out``.
        length: of the length check; none without a fixture.
    """

    def __init__(self, plan: Plan) -> None:
        self.robot = plan.robot
        self.plan = plan
        sets = SetSteps(plan.robot)
        trials = TrialSteps(plan.settings.stations.trial_mm, sets)
        noise = NoiseSteps(plan, sets)
        self.points = IdentificationSteps(
            plan, sets, plan.settings.identification.provisional, noise, trials
        )
        self.held_out_poses = HeldOutPoses(plan.settings, plan.robot, plan.effort.held_out_candidates)
        self.held_out = HeldOutSteps(len(plan.settings.verification.points), sets, trials)
        fixture = plan.settings.length_check
        self.length = None if fixture is None else LengthSteps(fixture, sets, trials)
