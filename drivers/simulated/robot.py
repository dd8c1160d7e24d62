"""The simulated robot as its controller drives it, with the geometry and the corrections of the config."""

import threading
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from drivers.simulated.imperfections import UM, leg_tensions
from drivers.simulated.linuxcnc.state import MotionRefused
from drivers.simulated.physics import RobotPhysics
from hexacell.cell.simulation import SimulatedLoad, SoftLimits
from hexacell.clock import CellClock
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout
from hexacell.errors import FileError
from hexacell.kinematics import rotations
from hexacell.kinematics.corrections import NO_CORRECTIONS
from hexacell.kinematics.forward import ForwardResult, continue_solution
from hexacell.kinematics.mechanism import Mechanism, joint_zeros
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.trajectory import interpolate_line

ROUNDS = 4
"""Steps of Newton's method, for joints a little off the inverse kinematics."""

RESTING = 1e-9
"""What is no motion of a joint, in its unit: the rounding of the inverse kinematics."""


def with_longer_legs(
    mechanism: Mechanism, controller: ControllerGeometry, poses: PoseBatch, joints: Array
) -> Array:
    """Joints (n, 6) for legs as long as play and compliance make them; ``joints`` are those without."""
    geometry, stated = controller.geometry, controller.corrections
    reached = np.flatnonzero(~np.isnan(joints).any(axis=1))
    if not (reached.size and any((*stated.play_mm, *stated.compliance_um_n))):
        return joints
    all_joints, poses, joints = joints.copy(), poses[reached], joints[reached]
    # On which side a leg lies does not depend on how heavy the platform is.
    newton = SimulatedLoad(
        weight_n=1.0, direction=stated.weight_direction, centre_mm=stated.weight_centre_mm
    )
    forces = leg_tensions(mechanism, geometry, poses, joints, newton)
    by_force = UM * np.array(stated.compliance_um_n) * stated.weight_n
    longer = 0.5 * np.array(stated.play_mm) * np.sign(forces) + by_force * forces
    for _ in range(ROUNDS):
        excess = mechanism.residual_and_jacobian(geometry, poses, joints)[0] - longer
        joints = joints - excess / mechanism.derivatives(geometry, poses, joints).joints
    all_joints[reached] = joints
    return all_joints


def directions_on(path: Array, before: Array) -> Array:
    """In which direction each joint moved last at rows of a path (k, 6); ``before`` is that at the first.

    A joint that stands keeps its direction.
    """
    directions = np.empty_like(path)
    directions[0] = before
    for row, step in enumerate(np.diff(path, axis=0), start=1):
        directions[row] = np.where(np.abs(step) > RESTING, np.sign(step), directions[row - 1])
    return directions


LINE_STEPS = 24
"""Fewest segments of a straight line, at whose ends joint variables are computed."""

LINE_MM = 0.2
"""Largest error of a joint in the middle of a segment, mm: near a leg's dead point segments are halved."""

MOST_STEPS = 1024


@dataclass(eq=False)
class SimulatedMachine:
    """The machine behind a controller that reads its geometry whenever it is switched on.

    With corrections in its config the joints that it commands and reports are those of legs as long as they
    are then; backlash is added to what it sends, and not reported. It takes effect with the first motion of
    a joint.

    Attributes:
        config: the file, or the files, with its geometry, in ``layout``.
        start: the pose in which it is at first, and its home.
        includes_zeros: the joints that it reports include the zeros of its geometry.
        fails_forward: its forward kinematics fails: the pose that it reports is that of its home.
        keeps_geometry: it does not read its geometry again.
        ignores_corrections: it reads corrections, and adds none of them to what it sends.
    """

    mechanism: Mechanism
    layout: ConfigLayout
    config: tuple[Path, ...]
    physics: RobotPhysics
    clock: CellClock
    start: Pose
    soft_limits: SoftLimits = field(default_factory=SoftLimits)
    includes_zeros: bool = False
    fails_forward: bool = False
    keeps_geometry: bool = False
    ignores_corrections: bool = False

    def __post_init__(self) -> None:
        self._geometry = self.layout.read(*self.config)
        home = self.mechanism.completed(self._geometry.geometry, PoseBatch.of([self.start]))
        self._line = home[[0, 0]]
        self._directions: Array = np.zeros((2, self.mechanism.joint_count))
        self._lock = threading.Lock()
        self._stop_count = 0
        self._stopped = threading.Event()

    def move(self, pose: Pose, duration_s: float | None = None) -> None:
        """Move straight to a pose, in no less than ``duration_s``; returns at the end or when stopped.

        Raises:
            MotionRefused: it is beyond a soft limit, or a pose on the line is out of reach.
        """
        limits = self.soft_limits
        for axis, value, low, high in zip(
            "XYZABC", pose.as_tuple(), limits.lowest, limits.highest, strict=True
        ):
            if not low <= value <= high:
                side = "positive" if value > high else "negative"
                raise MotionRefused(f"would exceed {axis}'s {side} limit")
        stop_count = self._stop_count
        with self._lock:
            here, before = self._pose_now(), self._directions[self._place()[0] + 1]
        target = self.mechanism.completed(self._geometry.geometry, PoseBatch.of([pose]))
        line, joints = self._straight_line(here, target)
        if np.isnan(joints).any():
            raise MotionRefused("fails kinematicsInverse")
        directions = directions_on(joints, before)
        backlash = np.array(self._geometry.corrections.backlash[: joints.shape[1]])
        joints = joints + 0.5 * backlash * directions
        with self._lock:
            if self._stop_count != stop_count:
                return
            self._stopped.clear()
            self._line, self._directions = line, directions
            motion = self.physics.start_motion(joints, duration_s)
        self.clock.wait(motion.duration_s, self._stopped)

    def stop(self) -> None:
        with self._lock:
            self._stop_count += 1
            self.physics.stop()
            self._stopped.set()

    def pose(self) -> Pose:
        """The pose by the controller's geometry, or of its home where its forward kinematics fails."""
        with self._lock:
            return self.start if self.fails_forward else self._pose_now().pose(0)

    def joints(self) -> tuple[float, ...]:
        """The joints (6,), mm, that the controller reports: as it commands, without backlash."""
        with self._lock:
            pose = self._pose_now()
            joints = with_longer_legs(self.mechanism, self._geometry, pose, self._joints(pose))[0]
            if self.includes_zeros:
                joints = joints + joint_zeros(self.mechanism, self._geometry.geometry)
            return tuple(float(value) for value in joints)

    def switch_on(self) -> None:
        """Read the geometry again; the joints stay, so the controller's pose changes.

        Raises:
            FileError: the config cannot be read, or its geometry has no pose at these joint variables.
        """
        if self.keeps_geometry:
            return
        with self._lock:
            here = self._pose_now()
            joints = with_longer_legs(self.mechanism, self._geometry, here, self._joints(here))
            new = self.layout.read(*self.config)
            if self.ignores_corrections:
                new = replace(new, corrections=NO_CORRECTIONS)
            found = self._pose_at(new, joints, here)
            if not found.found[0]:
                raise FileError(
                    "this geometry has no pose at the present joint variables", subject=self.config[0]
                )
            self.physics.commands_differ = new.geometry.largest_difference(self._geometry.geometry) > 0.0
            self._geometry = new
            self._directions = self._directions[[self._place()[0] + 1] * 2]
            self._line = found.poses[[0, 0]]

    def home(self) -> None:
        """The encoders are absolute: nothing to do."""

    def _pose_at(self, new: ControllerGeometry, joints: Array, here: PoseBatch) -> ForwardResult:
        """The pose that a controller with another config commands by the joints (1, 6) that it reports."""
        found = continue_solution(
            self.mechanism, new.geometry, joints, start=here, start_geometry=self._geometry.geometry
        )
        for _ in range(0 if new.corrections.are_none else ROUNDS):
            if not found.found[0]:
                break
            own = self.mechanism.inverse(new.geometry, new.branch, found.poses)
            added = with_longer_legs(self.mechanism, new, found.poses, own) - own
            found = continue_solution(
                self.mechanism, new.geometry, joints - added, start=found.poses, start_geometry=new.geometry
            )
        return found

    def _place(self) -> tuple[int, float]:
        """The row of the line that the present progress of the joints is behind, and how far."""
        place = self.physics.progress() * (len(self._line) - 1)
        row = min(int(place), len(self._line) - 2)
        return row, place - row

    def _pose_now(self) -> PoseBatch:
        """The pose on the line that the present progress of the joints corresponds to."""
        line, (row, share) = self._line, self._place()
        if share >= 1.0:
            return line[[row + 1]]
        turn = rotations.to_vector(line.rotations[row + 1] @ line.rotations[row].T)
        position = (1.0 - share) * line.positions[row] + share * line.positions[row + 1]
        return PoseBatch(position[None], (rotations.from_vector(share * turn) @ line.rotations[row])[None])

    def _straight_line(self, start: PoseBatch, end: PoseBatch) -> tuple[PoseBatch, Array]:
        """Poses (n) on a line and their joints (n, 6), between which joints may go at one rate."""
        steps = LINE_STEPS  # by how joints bend without corrections: with play they jump in any segment
        while True:
            line = self.mechanism.completed(
                self._geometry.geometry, interpolate_line(start, end, 2 * steps)
            )
            joints = self._joints(line)
            error = np.abs(joints[1::2] - 0.5 * (joints[:-1:2] + joints[2::2])).max()
            if not error > LINE_MM or steps >= MOST_STEPS:
                sent = with_longer_legs(self.mechanism, self._geometry, line, joints)
                return line[::2], sent[::2]
            steps *= 2

    def _joints(self, poses: PoseBatch) -> Array:
        return self.mechanism.inverse(self._geometry.geometry, self._geometry.branch, poses)
