"""Where the simulated gauges are: around the ball at a point, or in a seat of the fixture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hexacell.cell.length_check import LengthCheckSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.kinematics import rotations
from hexacell.kinematics.rotations import Array

FIRST, SECOND = 0, 1


class GaugePlaces:
    """Brings the gauges to the ball as a person does: into the middle of their travel, roughly.

    From the first seat of the fixture to the second, and back, they keep the distance of the seats.

    Attributes:
        station: (3,), mm, where the ball is in the middle of the gauges' travel.
        triad: (3, 3), rows: their measuring directions.
        on_placed: called with both when they were brought somewhere.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        fixture: LengthCheckSettings | None,
        random: np.random.Generator,
        ball: Array,
    ) -> None:
        self._settings = settings
        self._fixture = fixture
        self._random = random
        self._seat: int | None = None
        self.on_placed: Callable[[Array, Array], None] = lambda _station, _triad: None
        self._place_by_hand(ball)

    def stand(self, station: Array, triad: Array) -> None:
        """They stand here already."""
        self.station, self.triad = self._first = station, triad
        self._seat = FIRST if self._seat_at(station) == FIRST else None

    def follow(self, ball: Array) -> None:
        """Move the gauges to the ball, where that is at rest, if it is no longer at them."""
        if np.linalg.norm(ball - self.station) <= self._settings.station_reach_mm:
            return
        seat = self._seat_at(ball)
        if self._fixture is None or seat is None or self._seat is None or seat == self._seat:
            self._place_by_hand(ball)
        else:
            self._seat = seat
            self._mount(self._fixture, seat)
        self.on_placed(self.station, self.triad)

    def _place_by_hand(self, ball: Array) -> None:
        """The fixture is put where the gauges are in its first seat."""
        gauges, random = self._settings.gauges, self._random
        placed = gauges.placing_mm * random.standard_normal(3)
        tilt = np.radians(gauges.misalignment_deg)
        self.triad = rotations.from_vector(tilt * random.standard_normal(3))
        self.station = ball + placed - self.triad.T @ np.array(gauges.off_middle_mm)
        self._first = self.station, self.triad
        self._seat = FIRST if self._seat_at(ball) == FIRST else None

    def _mount(self, fixture: LengthCheckSettings, seat: int) -> None:
        simulated, (first, triad) = self._settings.fixture, self._first
        seated = simulated.seating_mm * self._random.standard_normal(3)
        if seat == FIRST:
            self.station, self.triad = first + seated, triad
            return
        distance = fixture.distance_mm if simulated.distance_mm is None else simulated.distance_mm
        towards = np.array(fixture.direction) / np.linalg.norm(fixture.direction)
        self.station = first + distance * (_about_z(simulated.yaw_deg) @ towards) + seated
        self.triad = _about_z(simulated.turned_deg).T @ triad

    def _seat_at(self, ball: Array) -> int | None:
        """The seat at which the ball is, if it is at one."""
        if self._fixture is None:
            return None
        seats = np.array([self._fixture.first_seat, self._fixture.second_seat])
        distances = np.linalg.norm(seats - ball, axis=1)
        nearest = int(distances.argmin())
        return nearest if distances[nearest] <= self._settings.station_reach_mm else None


def _about_z(degrees: float) -> Array:
    return rotations.from_vector(np.array([0.0, 0.0, np.radians(degrees)]))
