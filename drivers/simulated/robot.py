"""The simulated robot as its controller drives it: with the geometry of the config, not the truth."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

from drivers.simulated.linuxcnc.machine import KinematicsFailure
from drivers.simulated.physics import RobotPhysics
from hexacell.clock import CellClock
from hexacell.controller_config.interface import ConfigFormat, ControllerGeometry
from hexacell.errors import FileError
from hexacell.kinematics import rotations
from hexacell.kinematics.commanded_motion import change_geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.trajectory import interpolate_line

LINE_STEPS = 24
"""Straight lines are cut into so many pieces, which is where joints are computed."""


class SimulatedMachine:
    """Sliders under a controller that reads its geometry whenever it is switched on."""

    def __init__(
        self,
        mechanism: Mechanism,
        config_format: ConfigFormat,
        config: Path,
        physics: RobotPhysics,
        clock: CellClock,
        home: Pose,
    ) -> None:
        self._mechanism = mechanism
        self._format = config_format
        self._config = config
        self._physics = physics
        self._clock = clock
        self._geometry = config_format.read(config)
        self._way = PoseBatch.of([home, home])
        self._lock = threading.Lock()
        self._stops = 0
        self._halt = threading.Event()

    def move(self, pose: Pose) -> None:
        """Go straight to a pose; returns at the end or when stopped.

        Raises:
            KinematicsFailure: a leg cannot reach some place on the way.
        """
        stops = self._stops
        way = interpolate_line(PoseBatch.of([self.pose()]), PoseBatch.of([pose]), LINE_STEPS)
        joints = self._joints(way)
        if np.isnan(joints).any():
            raise KinematicsFailure("Linear move on line 0 fails kinematicsInverse")
        with self._lock:
            if self._stops != stops:
                return
            self._halt.clear()
            self._way = way
            motion = self._physics.start_motion(joints)
        self._clock.wait(motion.duration_s, self._halt)

    def stop(self) -> None:
        """Stop in place."""
        with self._lock:
            self._stops += 1
            self._physics.stop()
            self._halt.set()

    def pose(self) -> Pose:
        """Where the platform is by the controller's geometry."""
        with self._lock:
            return self._here().pose(0)

    def joints(self) -> tuple[float, ...]:
        """The sliders (6,), mm, as the controller commands them."""
        return tuple(float(value) for value in self._joints(PoseBatch.of([self.pose()]))[0])

    def switch_on(self) -> None:
        """Read the geometry again; the sliders stay, and so the believed pose changes.

        Raises:
            FileError: the config cannot be read, or no pose of its geometry belongs to the sliders.
        """
        with self._lock:
            here = self._here()
            joints = self._joints(here)
            new = self._format.read(self._config)
            found = change_geometry(self._mechanism, self._geometry.geometry, new.geometry, here, joints)
            if not found.found[0]:
                raise FileError("with this geometry the sliders cannot stand so", subject=self._config)
            self._geometry = new
            self._way = found.poses[[0, 0]]

    def switch_off(self) -> None:
        """Sliders hold by their brakes."""

    def home(self) -> None:
        """The encoders are absolute: nothing to look for."""

    def _here(self) -> PoseBatch:
        return _between(self._way, self._physics.progress())

    def _joints(self, poses: PoseBatch) -> Array:
        geometry: ControllerGeometry = self._geometry
        return self._mechanism.inverse(geometry.geometry, geometry.branch, poses)


def _between(way: PoseBatch, fraction: float) -> PoseBatch:
    place = fraction * (len(way) - 1)
    row = min(int(place), len(way) - 2)
    if place - row >= 1.0:
        return way[[row + 1]]
    turn = rotations.to_vector(way.rotations[row + 1] @ way.rotations[row].T)
    share = place - row
    position = (1.0 - share) * way.positions[row] + share * way.positions[row + 1]
    return PoseBatch(position[None], (rotations.from_vector(share * turn) @ way.rotations[row])[None])
