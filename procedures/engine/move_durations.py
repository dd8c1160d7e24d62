"""How long each move of a run takes, by the speeds of the cell file with and without gauges at the ball."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.campaign.budget import speed_limits
from hexacell.cell.model import CellSettings
from hexacell.config.layout import CurrentConfig
from hexacell.kinematics.pose import Pose
from hexacell.motion.duration import LineDurations
from procedures.run.state import RunState
from procedures.run.steps import Move, Phase, SetKey


@dataclass(frozen=True, eq=False)
class MoveDurations:
    """The durations of the moves of one cell, under the geometry that its controller has now."""

    settings: CellSettings
    config: CurrentConfig

    def of(self, start: Pose, step: Move, state: RunState) -> float:
        """The duration of a move from where the robot is, s; raises ``FileError``."""
        commanding = self.config.geometry()
        lines = LineDurations(self.settings.mechanism, commanding.geometry, commanding.branch)
        limits = speed_limits(self.settings.speed, at_gauges=gauges_are_at_ball(self.settings, step, state))
        return lines.of(start, step.target, limits)


def gauges_are_at_ball(settings: CellSettings, step: Move, state: RunState) -> bool:
    """Whether a move begins or ends with gauges at the ball.

    Where they are fixed they stand at every point. Placed by hand, they stand around the ball from then
    until the robot has left their point, and at any open set that it may be in.
    """
    if _are_fixed(settings, step.at):
        return True
    left = [] if state.at_pose is None else [state.at_pose[0]]
    return any(state.set(key).placed for key in (step.at, *left, *state.open_sets))


def _are_fixed(settings: CellSettings, at: SetKey) -> bool:
    if at.phase is Phase.LENGTH and settings.length_check is not None:
        return settings.length_check.mounting == "fixed"
    return settings.stations.placement == "fixed"
