"""A machine whose ball is measured in two seats, solved by leg equations alone."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hexacell.identification.placement import RecordPlacement
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.uncertainty.length_records import LengthRecords, LengthStandard
from tests.hexacell.uncertainty.conftest import Laboratory, Machine

Array = NDArray[np.float64]

NOTHING = np.zeros(3)
PROBE_MM = np.array([1.0, -0.8, 0.6])
TILTS = ((0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0))


@dataclass(frozen=True)
class TwoSeats:
    """A fixture, and what goes wrong with it.

    ``turned`` is how the gauges of the second seat are turned, ``zeroed_mm`` what they show less from the
    second mounting on.
    """

    distance_mm: float = 300.0
    direction: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    start: Array = field(default_factory=lambda: np.array([-150.0, 0.0, 500.0]))
    mountings: int = 3
    seating_mm: float = 0.0
    turned: Rotation = field(default_factory=Rotation.identity)
    zeroed_mm: Array = field(default_factory=lambda: NOTHING)

    def records(
        self,
        laboratory: Laboratory,
        found: Identification,
        machine: Machine,
        noise_mm: float = 0.0,
        random: np.random.Generator | None = None,
    ) -> LengthRecords:
        """The records of a machine that is commanded with what was found."""
        random = random or np.random.default_rng(0)
        rows = [row for mounting in range(1, self.mountings + 1) for row in self._poses(mounting)]
        shown = [self._shown(found, pose, laboratory) for _, pose in rows]
        balls = np.array(
            [laboratory.reached(machine, q, pose)[:3] for q, (_, pose) in zip(shown, rows, strict=True)]
        )
        mountings = np.array([mounting for mounting, _ in rows])
        deviations = self._deviations(mountings, balls, random)
        deviations += noise_mm * random.standard_normal(deviations.shape)
        joints = np.array(shown) + noise_mm * random.standard_normal((len(rows), 6))
        commands = PoseBatch(
            np.concatenate([pose.positions for _, pose in rows]),
            np.concatenate([pose.rotations for _, pose in rows]),
        )
        commanded = RecordPlacement(
            found.problem.mechanism,
            found.geometry,
            commands,
            joints,
            deviations,
            np.eye(3),
            np.zeros_like(joints),
            np.zeros_like(joints),
        )
        return LengthRecords.of(commanded, mountings)

    def standard(self, **others: Any) -> LengthStandard:
        return LengthStandard(
            self.distance_mm, seating_mm=max(self.seating_mm, 1e-9), **{"certificate_mm": 1e-9, **others}
        )

    def _poses(self, mounting: int) -> list[tuple[int, PoseBatch]]:
        second = mounting % 2 == 0
        place = self.start + (self.distance_mm * self.direction if second else NOTHING)
        beside = [(place + PROBE_MM, (0.0, 0.0)), *((place, tilt) for tilt in TILTS)]
        return [(mounting, _pose(position, *tilt)) for position, tilt in beside]

    def _shown(self, found: Identification, pose: PoseBatch, laboratory: Laboratory) -> Array:
        turn = Rotation.from_matrix(pose.rotations[0]).as_rotvec()
        joints: Array = laboratory.legs(found.geometry).joints(np.concatenate([pose.positions[0], turn]))
        return joints

    def _deviations(self, mountings: NDArray[np.int_], balls: Array, random: np.random.Generator) -> Array:
        """What the gauges show, zeroed at the ball's first place; the fixture is fixed to the base."""
        zero = balls[1]
        deviations = np.empty_like(balls)
        for number in np.unique(mountings):
            rows, second = mountings == number, number % 2 == 0
            seat = zero + (self.distance_mm * self.direction if second else NOTHING)
            seat = seat + self.seating_mm * random.standard_normal(3)
            shown = balls[rows] - seat
            deviations[rows] = self.turned.apply(shown) if second else shown
            deviations[rows] -= self.zeroed_mm if number > 1 else NOTHING
        return deviations


def _pose(position: Array, a: float, b: float) -> PoseBatch:
    x, y, z = position.tolist()
    return PoseBatch.of([Pose(x, y, z, a, b)])
