"""The steps of a length check: the ball in the first seat, in the second, and in the first again.

Each mounting of the gauges is a set. Its records are at the middle of the seat, level and tilted, and one
is beside it: that shows that every gauge is the right way round. The gauges keep the zero of the first
mounting. From the second one on they are mounted while the ball is beside the middle. So gauges that
somebody zeroes out of habit do not show the same as before.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps.events import Step
from procedures.steps.locate import Locate
from procedures.steps.move import Move
from procedures.workflow.sets import NoSafePath, SetSteps, TravelError

BESIDE_MM = np.array([1.0, -0.8, 0.6])
"""From the middle of a seat to the record beside it: no two gauges see the same."""


@dataclass(frozen=True, eq=False)
class LengthSteps:
    """Decides on the steps."""

    fixture: LengthCheckSettings
    sets: SetSteps

    def next_step(self, state: RunState) -> Step | None:
        """The next step of the first mounting that is not closed; None if all are."""
        for mounting in range(1, self.fixture.mountings + 1):
            key = SetKey(phase=Phase.LENGTH, point=mounting)
            if not state.set(key).closed:
                return Locate() if state.position_unknown else self._in_set(state, key)
        return None

    def planned_poses(self) -> tuple[tuple[str, Pose], ...]:
        """All poses with their names, if the fixture is where the cell file has it."""
        return tuple(
            (f"length check, seat {key.seat}, orientation {number}", self._pose(key, number, np.zeros(3)))
            for key in [SetKey(phase=Phase.LENGTH, point=mounting) for mounting in (1, 2)]
            for number in range(1, self.fixture.orientations + 2)
        )

    def _in_set(self, state: RunState, key: SetKey) -> Step:
        measured = state.set(key)
        if measured.rejections:
            raise TravelError(
                f"{key}: the ball left the gauges' travel in seat {key.seat} of the fixture",
                action="Check first_seat, direction and distance_mm in [length_check], and how the fixture "
                "lies; then mount the gauges there again",
            )
        zero = self.sets.known(state, key)[1]  # where the ball is with the gauges at zero
        if step := self.sets.due_first(state, key, zero):
            return step
        if (orientation := measured.next_orientation) > self.fixture.orientations + 1:
            return self.sets.at_or_to_reference(state, key, zero)
        samples = measured.samples  # where the seat is beside its stated place, by the first reading in it
        is_known = key.point != 1 and bool(samples)
        off = BESIDE_MM - np.array(samples[0].deviation_mm) if is_known else np.zeros(3)
        pose = self._pose(key, orientation, off).as_tuple()
        move = Move(at=key, orientation=orientation, pose=pose)
        if not self.sets.robot.refused.allows(pose):
            raise NoSafePath(
                f"{key}: the controller refuses {move.target} in seat {key.seat} of the fixture",
                action="Lower tilt_deg in [length_check], or put the fixture elsewhere",
            )
        return self.sets.at_pose(state, key) or self.sets.towards(state, move, zero)

    def _pose(self, key: SetKey, orientation: int, off_mm: Array) -> Pose:
        """A pose of a mounting whose seat is ``off_mm`` (3,) from where the cell file has it."""
        seat = self.fixture.first_seat if key.seat == 1 else self.fixture.second_seat
        is_beside = orientation == (2 if key.point == 1 else 1)
        position = np.array(seat) + off_mm + (BESIDE_MM if is_beside else 0.0)
        tilts = orientation - 2
        about = 2.0 * np.pi * (tilts - 1) / max(1, self.fixture.orientations - 1)
        tilt = self.fixture.tilt_deg if tilts > 0 else 0.0
        x, y, z = position.tolist()
        return Pose(x, y, z, float(tilt * np.cos(about)), float(tilt * np.sin(about)))
