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
from tests.hexacell.conftest import vector
from tests.hexacell.uncertainty.conftest import Laboratory, Machine

Array = NDArray[np.float64]

NOTHING = np.zeros(3)
PROBE_MM = np.array([1.0, -0.8, 0.6])
TILTS = ((0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0))


@dataclass(frozen=True)
class TwoSeats:
    """A fixture, and what goes wrong with it.

    ``turned`` is how the gauges of the second seat are turned, ``zeroed_mm`` what they show less from the
    second mounting on, ``true_mm`` the distance of the seats if it is another than is stated.
    """

    distance_mm: float = 300.0
    direction: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    start: Array = field(default_factory=lambda: np.array([-150.0, 0.0, 500.0]))
    mountings: int = 3
    seating_mm: float = 0.0
    turned: Rotation = field(default_factory=Rotation.identity)
    zeroed_mm: Array = field(default_factory=lambda: NOTHING)
    true_mm: float | None = None

    def commands(self) -> list[tuple[int, Pose]]:
        """The poses with their mountings, in their order."""
        rows = []
        for mounting in range(1, self.mountings + 1):
            place = self.start + (NOTHING if mounting % 2 else self.distance_mm * self.direction)
            x, y, z = place.tolist()
            rows += [(mounting, Pose(x, y, z, *tilt)) for tilt in TILTS]
            rows.append((mounting, Pose(*(place + PROBE_MM).tolist())))
        return rows

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
        rows = self.commands()
        commands = PoseBatch.of(pose for _, pose in rows)
        shown = [laboratory.legs(found.geometry).joints(vector(pose)) for _, pose in rows]
        balls = np.array(
            [laboratory.reached(machine, q, commands[[row]])[:3] for row, q in enumerate(shown)]
        )
        mountings = np.array([mounting for mounting, _ in rows])
        deviations = self.deviations(mountings, balls, random)
        deviations += noise_mm * random.standard_normal(deviations.shape)
        joints = np.array(shown) + noise_mm * random.standard_normal((len(rows), 6))
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

    def deviations(self, mountings: NDArray[np.int_], balls: Array, random: np.random.Generator) -> Array:
        """What the gauges show, zeroed at the ball's first place; the fixture is fixed to the base."""
        apart = (self.true_mm or self.distance_mm) * self.direction
        deviations = np.empty_like(balls)
        for number in np.unique(mountings):
            rows, second = mountings == number, number % 2 == 0
            seat = balls[0] + (apart if second else NOTHING)
            seat = seat + self.seating_mm * random.standard_normal(3)
            shown = balls[rows] - seat
            deviations[rows] = self.turned.apply(shown) if second else shown
            deviations[rows] -= self.zeroed_mm if number > 1 else NOTHING
        return deviations
