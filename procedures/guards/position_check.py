"""Whether controller and encoders agree on where the robot is, under the geometry of the config.

A pose that a controller reports is only believed if they do: after a failed forward kinematics it may be
that of home, and a controller that runs another geometry than its config states reports another pose.

A controller computes the pose that it reports from its joint variables. Under its own geometry the joint
variables of that pose are therefore those that it has, up to rounding; the encoders agree with both within
what their zeros may be off. If two of the three agree, the third is the odd one:

    pose - joints   joints - encoders   pose - encoders   odd
    differ          agree                                 the pose: another geometry than the one compared
                                                          with, or a forward kinematics that failed
    agree           differ                                the encoders
    differ          differ              agree             the joint variables
    differ          differ              differ            unknown

A pose that the encoders still agree with, but the joint variables do not, is that of a geometry which
differs a little: one that was edited, or not read again.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from drivers.errors import NotHomedError
from drivers.interfaces import EncoderSample
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import CurrentConfig
from hexacell.identification.terms.corrected_joints import commanded_joints
from hexacell.kinematics.mechanism import Mechanism, completed_pose, joint_zeros
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices
from procedures.guards.polling import POLL_PAUSE_S
from procedures.run.trips import Guard, Trip

ATTEMPTS = 5
"""Reports are read one after the other, and are read again if a joint moved a little in between."""


class PositionSource(StrEnum):
    """What reports where the robot is."""

    POSE = "pose"
    JOINTS = "joints"
    ENCODERS = "encoders"


@dataclass(frozen=True, slots=True, eq=False)
class PositionReports:
    """Where the robot is by its controller and by its encoders, at one standstill.

    Attributes:
        pose: by the controller's forward kinematics.
        joints: the controller's joint variables (6,), mm; None where it reports none.
        encoders: joint variables (6,), mm, by the encoders.
    """

    pose: Pose
    joints: Array | None
    encoders: Array


@dataclass(frozen=True, slots=True)
class PositionMismatch:
    """Reports that do not agree.

    Attributes:
        odd: the one that the two others contradict; None where no two agree.
        leg: the leg, counted from 1, with the largest difference.
        by_pose: its joint variable by the reported pose; None where a leg cannot reach that.
        joint: its joint variable by the controller, and ``encoder`` by its encoder.
        is_pose_near: whether the encoders agree with the reported pose.
    """

    odd: PositionSource | None
    leg: int
    by_pose: float | None
    joint: float | None
    encoder: float
    is_pose_near: bool


def position_mismatch(
    mechanism: Mechanism,
    config: ControllerGeometry,
    reports: PositionReports,
    *,
    position_mm: float,
    following: float,
) -> PositionMismatch | None:
    """How reports disagree under the controller's config, at the leg where most; None if they agree.

    They agree if a reported position is off by at most ``position_mm``, and an encoder from its joint by at
    most ``following``, mm.
    """
    by_pose, rounding = _joints_of(mechanism, config, reports.pose, position_mm)
    from_encoders = _excess(by_pose - reports.encoders, rounding + following)
    odd: PositionSource | None = None
    excess = from_encoders
    if reports.joints is not None:
        from_joints = _excess(by_pose - reports.joints, rounding)
        between = _excess(reports.joints - reports.encoders, np.full_like(reports.encoders, following))
        if _agree(from_joints):
            odd, excess = PositionSource.ENCODERS, between
        elif _agree(between):
            odd, excess = PositionSource.POSE, from_joints
        else:
            odd, excess = PositionSource.JOINTS if _agree(from_encoders) else None, between
    if _agree(excess):
        return None
    leg = int(np.argmax(excess))
    return PositionMismatch(
        odd=odd,
        leg=leg + 1,
        by_pose=float(by_pose[leg]) if np.isfinite(by_pose[leg]) else None,
        joint=None if reports.joints is None else float(reports.joints[leg]),
        encoder=float(reports.encoders[leg]),
        is_pose_near=_agree(from_encoders),
    )


def _joints_of(
    mechanism: Mechanism, config: ControllerGeometry, pose: Pose, position_mm: float
) -> tuple[Array, Array]:
    """Joint variables (6,), mm, of a pose, NaN if it is out of reach; what its tolerance does to them."""
    poses = PoseBatch.of([pose])
    states = config.geometry, config.branch, config.corrections
    [joints], [unknown] = commanded_joints(mechanism, *states, poses)
    derivatives = mechanism.derivatives(config.geometry, poses, np.nan_to_num(joints)[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        by_legs = derivatives.pose[0, : len(joints), :3]
        slopes = np.linalg.norm(by_legs, axis=-1) / np.abs(derivatives.joints[0])
    rounding = position_mm * np.maximum(1.0, np.nan_to_num(slopes, nan=1.0, posinf=1.0))
    return joints, rounding + unknown


def _excess(differences: Array, tolerances: Array) -> Array:
    """Differences (6,) as multiples of their tolerances; infinite for a pose out of reach."""
    return np.nan_to_num(np.abs(differences), nan=np.inf) / tolerances


def _agree(excess: Array) -> bool:
    return bool(excess.max() <= 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class CheckedPosition:
    """Where the robot is, or why that is not known.

    Attributes:
        reports: what was read; None before the controller is homed.
        trip: why they are not believed; None if they are.
        odd: which report contradicts the others; None if they agree, or no two do.
    """

    reports: PositionReports | None
    trip: Trip | None = None
    odd: PositionSource | None = None


@dataclass(frozen=True, eq=False)
class PositionCheck:
    """Reads and compares the reports of one cell."""

    settings: CellSettings
    devices: Devices
    clock: CellClock
    config: CurrentConfig

    async def read(
        self, encoders: EncoderSample | None = None, *, following: float | None = None
    ) -> CheckedPosition:
        """Where the robot is, by this sample of the ``encoders`` or a new one; raises ``HexacellError``.

        An encoder may be ``following`` from its joint, in their unit; by default as the cell file states.
        """
        following = following or self.settings.guards.following
        try:
            found = await self._compared(following, encoders or await self.devices.read_encoders())
        except NotHomedError:
            return CheckedPosition(None, _NOT_HOMED)
        for _ in range(1, ATTEMPTS):
            if found.trip is None or found.reports is None:
                break
            await self.clock.sleep(POLL_PAUSE_S * self.clock.factor)
            found = await self._compared(following, await self.devices.read_encoders())
        return found

    async def _compared(self, following: float, encoders: EncoderSample) -> CheckedPosition:
        reported = await self.devices.controller.position()
        if reported is None:
            return CheckedPosition(None, _NOT_HOMED)
        mechanism, commanding = self.settings.mechanism, self.config.geometry()
        joints = None if reported.joints is None else np.array(reported.joints)
        if joints is not None and self.settings.controller.joints_include_zeros:
            joints = joints - joint_zeros(mechanism, commanding.geometry)
        reports = PositionReports(self.completed(reported.pose), joints, np.array(encoders.positions))
        mismatch = position_mismatch(
            mechanism,
            commanding,
            reports,
            position_mm=self.settings.controller.position_tolerance_mm,
            following=following,
        )
        if mismatch is None:
            return CheckedPosition(reports)
        return CheckedPosition(reports, self._trip(mismatch, reports, following), mismatch.odd)

    def completed(self, pose: Pose) -> Pose:
        """A pose as the controller reports it, with those angles that the robot does not have."""
        geometry = self.config.geometry().geometry
        return completed_pose(self.settings.mechanism, geometry, pose)

    def _trip(self, found: PositionMismatch, reports: PositionReports, following: float) -> Trip:
        joint = f"{self.settings.mechanism.words.joint} {found.leg}"
        match found.odd:
            case PositionSource.POSE:
                return self._odd_pose(found, reports)
            case PositionSource.JOINTS:
                problem = (
                    f"reports {joint} at {self._place(found.joint)} where its pose has it at "
                    f"{self._place(found.by_pose)} and the encoder at {self._place(found.encoder)}"
                )
                return _position_trip("controller", problem, "Home it again, then retry")
            case PositionSource.ENCODERS:
                problem = (
                    f"shows {joint} at {self._place(found.encoder)} where the controller's pose and joints "
                    f"have it at {self._place(found.joint)} (limit {following:g} "
                    f"{self.settings.mechanism.words.joint_unit})"
                )
                action = "See whether it slipped or lost its zero, or the controller was homed wrongly"
                return _position_trip(f"encoder {found.leg}", problem, f"{action}; then retry")
        return self._contradiction(found, reports)

    def _odd_pose(self, found: PositionMismatch, reports: PositionReports) -> Trip:
        path = self.config.path
        problem = (
            f"reports the pose {reports.pose}, {self._at_pose(found)}; its joints and the encoders have "
            f"it at {self._place(found.joint)}. "
        )
        other = "it runs another geometry than this file has"
        again = f"Make it read {path} again, or name the file that it runs in controller.config"
        if found.is_pose_near:
            return _position_trip("controller", f"{problem}So {other}", f"{again}; then retry")
        problem += f"So its forward kinematics failed and the pose is that of its home, or {other}"
        action = "Bring it to another pose joint by joint, until it reports where it is. Or: "
        return _position_trip("controller", problem, f"{action}{again}; then retry")

    def _contradiction(self, found: PositionMismatch, reports: PositionReports) -> Trip:
        """No two reports agree, or there are only two."""
        problem = f"reports the pose {reports.pose}, {self._at_pose(found)}; "
        if found.joint is None:
            problem += f"its encoder shows {self._place(found.encoder)}, the controller reports no joints"
        else:
            joint, encoder = self._place(found.joint), self._place(found.encoder)
            problem += f"its joints have it at {joint}, its encoder at {encoder}"
        action = (
            f"Find out where the robot is and home it; make it read {self.config.path} again; then retry"
        )
        return _position_trip("controller", problem, action)

    def _place(self, value: float | None) -> str:
        return "no place" if value is None else f"{value:.3f} {self.settings.mechanism.words.joint_unit}"

    def _at_pose(self, found: PositionMismatch) -> str:
        name = self.config.path.name
        if found.by_pose is None:
            return f"which leg {found.leg} cannot reach by {name}"
        joint = self.settings.mechanism.words.joint
        return f"where {name} has {joint} {found.leg} at {self._place(found.by_pose)}"


def _position_trip(device: str, problem: str, action: str) -> Trip:
    return Trip(Guard.POSITION, device, problem, action)


_NOT_HOMED = _position_trip(
    "controller", "is not homed: where the robot is, is not known", "Home it, then retry"
)
