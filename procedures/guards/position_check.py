"""Whether controller and encoders agree on where the robot is, under the geometry of the config.

A pose that a controller reports is only believed if they do: after a failed forward kinematics it may be
that of home, and a controller that runs another geometry than its config states reports another pose.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.errors import NotHomedError
from drivers.interfaces import EncoderSample
from hexacell.cell.model import CellSettings
from hexacell.clock import CellClock
from hexacell.config.layout import CurrentConfig
from hexacell.kinematics.mechanism import joint_zeros
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.position_agreement import (
    AgreementTolerances,
    PositionMismatch,
    PositionReports,
    PositionSource,
    position_mismatch,
)
from hexacell.kinematics.rotations import Array
from procedures.devices.device_set import Devices
from procedures.guards.polling import POLL_PAUSE_S
from procedures.run.trips import Guard, Trip

ATTEMPTS = 5
"""Reports are read one after the other, and are read again if a joint moved a little in between."""


@dataclass(frozen=True, slots=True, eq=False)
class CheckedPosition:
    """Where the robot is, or why that is not known.

    Attributes:
        reports: what was read; none before the controller is homed.
        trip: why they are not believed; none if they are.
        odd: which report contradicts the others; none if they agree, or no two do.
    """

    reports: PositionReports | None
    trip: Trip | None = field(default=None)
    odd: PositionSource | None = field(default=None)


@dataclass(frozen=True, eq=False)
class PositionCheck:
    """Reads and compares the reports of one cell."""

    settings: CellSettings
    devices: Devices
    clock: CellClock
    config: CurrentConfig

    async def read(self, encoders: EncoderSample | None = None) -> CheckedPosition:
        """Where the robot is, if ``encoders`` were read already with that sample of them.

        Raises:
            HexacellError: a device or the config cannot be read.
        """
        try:
            found = await self._compared(encoders or await self.devices.read_encoders())
        except NotHomedError:
            return CheckedPosition(None, _not_homed())
        for _ in range(1, ATTEMPTS):
            if found.trip is None or found.reports is None:
                break
            await self.clock.sleep(POLL_PAUSE_S * self.clock.factor)
            found = await self._compared(await self.devices.read_encoders())
        return found

    async def _compared(self, encoders: EncoderSample) -> CheckedPosition:
        reports = await self._reports(encoders)
        if reports is None:
            return CheckedPosition(None, _not_homed())
        mismatch = self._mismatch(reports)
        if mismatch is None:
            return CheckedPosition(reports)
        return CheckedPosition(reports, self._trip(mismatch, reports), mismatch.odd)

    async def _reports(self, encoders: EncoderSample) -> PositionReports | None:
        reported = await self.devices.controller.position()
        if reported is None:
            return None
        joints = None if reported.joints is None else np.array(reported.joints) - self._zeros_told()
        return PositionReports(reported.pose, joints, np.array(encoders.positions))

    def _zeros_told(self) -> Array:
        """What the joints that the controller tells are more than the joint variables (6,)."""
        if not self.settings.controller.joints_include_zeros:
            return np.zeros(6)
        return joint_zeros(self.settings.mechanism, self.config.geometry().geometry)

    def _mismatch(self, reports: PositionReports) -> PositionMismatch | None:
        commanding = self.config.geometry()
        tolerances = AgreementTolerances(
            self.settings.controller.position_tolerance_mm, self.settings.guards.following
        )
        return position_mismatch(
            self.settings.mechanism, commanding.geometry, commanding.branch, reports, tolerances
        )

    def _trip(self, found: PositionMismatch, reports: PositionReports) -> Trip:
        joint = f"{self._joint} {found.leg}"
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
                    f"have it at {self._place(found.joint)} "
                    f"(limit {self.settings.guards.following:g} {self._unit})"
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
            problem += f"its encoder shows {self._place(found.encoder)}, and the controller tells no joints"
        else:
            joint, encoder = self._place(found.joint), self._place(found.encoder)
            problem += f"its joints have it at {joint}, its encoder at {encoder}"
        action = (
            f"Find out where the robot is and home it; make it read {self.config.path} again; then retry"
        )
        return _position_trip("controller", problem, action)

    @property
    def _joint(self) -> str:
        return self.settings.mechanism.words.joint

    @property
    def _unit(self) -> JointUnit:
        return self.settings.mechanism.words.joint_unit

    def _place(self, value: float | None) -> str:
        return "no place" if value is None else f"{value:.3f} {self._unit}"

    def _at_pose(self, found: PositionMismatch) -> str:
        name = self.config.path.name
        if found.by_pose is None:
            return f"which leg {found.leg} cannot reach by {name}"
        return f"where {name} has {self._joint} {found.leg} at {self._place(found.by_pose)}"


def _position_trip(device: str, problem: str, action: str) -> Trip:
    return Trip(Guard.POSITION, device, problem, action)


def _not_homed() -> Trip:
    return _position_trip(
        "controller", "is not homed: where the robot is, is not known", "Home it, then retry"
    )
