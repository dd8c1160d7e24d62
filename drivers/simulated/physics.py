"""The true state of a simulated cell: actual joint variables, actual ball position, and the sensors.

Joints move along given paths at one rate with ramps at its ends, and can be stopped at any time. The
pose under the true geometry is computed by continuation, so that the assembly mode is kept. What
is not geometry is in :mod:`~drivers.simulated.imperfections`. Gauges and encoders add noise.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drivers.simulated.imperfections import Backlash, LoadedMachine
from hexacell.cell.devices import ThermometerSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.cell.uncertainty import LengthCheckSettings
from hexacell.clock import CellClock
from hexacell.config.interface import ControllerGeometry
from hexacell.errors import ReachError
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism, inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

RAMP_S = 0.2
"""Time to reach the speed of a motion, and to slow down at its end."""
USUAL_REACH_MM = 30.0
"""Distance from the gauges beyond which they are moved to the ball, where points are not nearer."""
AXES = "xyz"
RINGING_HZ = 8.0
FIRST, SECOND = 0, 1


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of the joints along a path at one rate, with ramps of ``RAMP_S`` at its ends.

    Attributes:
        path: joint variables (k, 6), evenly spaced.
        start_s: time of the start, on the cell's clock.
        duration_s: from standstill to standstill.
        stopped_s: when it was stopped before its end.
    """

    path: Array
    start_s: float
    duration_s: float
    stopped_s: float = np.inf

    @property
    def end_s(self) -> float:
        """When the joints reach standstill."""
        return min(self.start_s + self.duration_s, self.stopped_s)

    def fraction(self, now_s: float) -> float:
        """The completed fraction of the path, 0 to 1."""
        elapsed = max(0.0, min(now_s, self.stopped_s) - self.start_s)
        left = self.duration_s - elapsed
        if left <= 0.0:
            return 1.0
        ramp = min(RAMP_S, 0.5 * self.duration_s)
        rate = 1.0 / (self.duration_s - ramp)
        if min(elapsed, left) < ramp:
            speeding = 0.5 * rate * min(elapsed, left) ** 2 / ramp
            return speeding if elapsed < left else 1.0 - speeding
        return rate * (elapsed - 0.5 * ramp)

    def path_position(self, now_s: float) -> float:
        """The position on the path, in rows."""
        return self.fraction(now_s) * (len(self.path) - 1)

    def joints(self, now_s: float) -> Array:
        """The joint variables (6,), at a time."""
        position = self.path_position(now_s)
        below = min(int(position), len(self.path) - 2)
        share = position - below
        return np.asarray((1.0 - share) * self.path[below] + share * self.path[below + 1])


class GaugePlaces:
    """Brings the gauges to the ball as a person does: into the middle of their travel, roughly.

    From the first seat of the fixture to the second, and back, they keep the distance of the seats.

    Attributes:
        station: (3,), mm, where the ball is in the middle of the gauges' travel.
        triad: (3, 3), rows: their measuring directions.
        on_placed: called with both when they were brought somewhere.
        are_taken_off: they are mounted anew where the ball rests next, however near.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        fixture: LengthCheckSettings | None,
        random: np.random.Generator,
        ball: Array,
    ) -> None:
        self._settings = settings
        self._reach_mm = settings.station_reach_mm or USUAL_REACH_MM
        self._fixture = fixture
        self._random = random
        self._seat: int | None = None
        self.are_taken_off = False
        self.on_placed: Callable[[Array, Array], None] = lambda _station, _triad: None
        self._place_by_hand(ball)

    def stand(self, station: Array, triad: Array) -> None:
        """They stand here already."""
        self.station, self.triad = self._first = station, triad
        self._seat = FIRST if self._seat_at(station) == FIRST else None

    def follow(self, ball: Array) -> None:
        """Move the gauges to the ball, where that is at rest, if it is no longer at them."""
        stay, self.are_taken_off = not self.are_taken_off, False
        if stay and np.linalg.norm(ball - self.station) <= self._reach_mm:
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
        self.triad = rotations.from_vector(np.radians(gauges.misalignment_deg) * random.standard_normal(3))
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
        return nearest if distances[nearest] <= self._reach_mm else None


def _about_z(degrees: float) -> Array:
    return rotations.from_vector(np.array([0.0, 0.0, np.radians(degrees)]))


class RobotPhysics:
    """The true state of one cell. Thread-safe.

    Attributes:
        on_motion_start: called when a motion has started; must return quickly.
        commands_differ: the next motion is by another geometry, so that the gauges are mounted anew.
        gauges: where they are.

    It starts where a controller with the geometry ``commanding`` puts the joints for ``home``. The joints
    go where the encoders show what is commanded. ``fixture`` has the seats of a length check, if any.
    Raises ``ReachError`` if ``home`` is out of reach of that geometry or of the true one.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: SimulationSettings,
        clock: CellClock,
        commanding: ControllerGeometry,
        home: Pose,
        fixture: LengthCheckSettings | None = None,
    ) -> None:
        self._truth = Geometry.of(mechanism.parameters, settings.geometry.model_dump())
        self.on_motion_start: Callable[[], None] = lambda: None
        self._settings = settings
        self._clock = clock
        self._random = np.random.default_rng(settings.seed)
        # Of its own: a cell without this scatter is the same whether or not it could have it.
        self._random_unseen = np.random.default_rng([settings.seed, 1])
        self._lock = threading.RLock()
        start = PoseBatch.of([home])
        self._shown_per_mm = 1.0 + 1e-6 * settings.encoders.common_scale_um_m
        shown = inverse_kinematics(mechanism, commanding.geometry, commanding.branch, start)
        joints = shown / self._shown_per_mm
        self._legs = mechanism.joint_count
        self._motion = Motion(joints[[0, 0]], -1e9, 0.0)  # standstill
        self._rows_passed = self._moves = 0
        self.commands_differ = False
        self._unseen = np.zeros_like(joints[0]), np.zeros_like(joints[0])
        first = continue_solution(
            mechanism, self._truth, joints, start=start, start_geometry=commanding.geometry
        )
        if not first.found[0]:
            raise ReachError(
                f"the simulated machine cannot reach {home}",
                action="Correct [simulation.geometry], or start at another point",
            )
        self._machine = LoadedMachine(mechanism, self._truth, settings)
        self._start_s = self._walked_s = clock.now()
        self._random_walk, self._walked_mm = np.random.default_rng([settings.seed, 3]), np.zeros(3)
        gaps, of_its_own = np.array(settings.joints.backlash), np.random.default_rng([settings.seed, 2])
        self._backlash = Backlash(gaps, joints[0], of_its_own)
        self._pose, self._joints, self._warmer_k = first.poses, np.full_like(joints[0], np.nan), 0.0
        self._move_platform(joints[0])
        self.gauges = GaugePlaces(settings, fixture, self._random, self._pose.positions[0])
        self._draw_noise()

    def start_motion(self, path: Array, duration_s: float | None = None) -> Motion:
        """Start a motion from here along a path (k, 6), mm, as the encoders show it; returns at once.

        Apart from its ends it lasts ``duration_s``, or longer where the machine is not as fast.
        """
        motion = self._settings.motion
        with self._lock:
            distance = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
            worn, self._moves = (1.0 + motion.growth_per_move) ** self._moves, self._moves + 1
            scatter = worn * motion.repeatability * self._random.standard_normal(self._legs)
            actual = path / self._shown_per_mm + np.linspace(0.0, 1.0, len(path))[:, None] * scatter
            actual[0] = self._motion.joints(self._update())
            self._unseen = (
                self._unseen[1],
                worn * motion.unseen_repeatability * self._random_unseen.standard_normal(self._legs),
            )
            stated_s = 0.0 if duration_s is None else duration_s + RAMP_S
            duration = max(motion.minimum_s, distance / motion.speed, stated_s)
            self._motion, self._rows_passed = Motion(actual, self._clock.now(), duration), 0
            self.gauges.are_taken_off |= self.commands_differ
            self.commands_differ = False
            self._draw_noise()
            self.on_motion_start()
            return self._motion

    def stop(self) -> None:
        """Stop the joints at their present positions."""
        with self._lock:
            now = self._clock.now()
            if now < self._motion.end_s:
                self._motion = replace(self._motion, stopped_s=now)

    def progress(self) -> float:
        """The completed fraction of the last motion, 0 to 1."""
        with self._lock:
            return self._motion.fraction(self._clock.now())

    def celsius(self, thermometer: ThermometerSettings) -> float:
        """What a thermometer on a leg, or anywhere else on the machine, shows now, deg C."""
        stated, legs = self._settings.temperature, thermometer.legs
        share = stated.legs_share[legs[0] - 1] if legs else 1.0
        return stated.start_c + share * self._machine.warmer_k(self._clock.now() - self._start_s)

    def encoder_positions(self) -> Array:
        """The joint variables measured by the encoders (6,), mm."""
        with self._lock:
            flicker = self._settings.encoders.flicker * self._random.standard_normal(self._legs)
            shown = self._shown_per_mm * self._motion.joints(self._clock.now())
            return shown + self._encoder_noise + flicker

    def gauge_displacement(self, axis: str) -> float:
        """The ball's displacement along a gauge's axis from the middle of its travel, with noise, mm."""
        with self._lock:
            now = self._update()
            ball: Array = self._pose.positions[0]
            if now >= self._motion.end_s:
                ball = ball + self._ringing(now - self._motion.end_s)
                self.gauges.follow(ball)
            displacement = (
                self.gauges.triad @ (ball - self.gauges.station) + self._gauge_noise + self._walked_mm
            )
            flicker = self._settings.gauges.flicker_mm * self._random.standard_normal()
            return float(displacement[AXES.index(axis)] + flicker)

    def _draw_noise(self) -> None:
        """Draw the noise of the next stop; the mounts of the gauges have drifted since the last one."""
        minutes, self._walked_s = (self._clock.now() - self._walked_s) / 60.0, self._clock.now()
        step_mm = 1e-3 * self._settings.gauges.drift_um * np.sqrt(max(0.0, minutes))
        self._walked_mm = self._walked_mm + step_mm * self._random_walk.standard_normal(3)
        self._ringing_direction = self._random.standard_normal(3)
        self._gauge_noise = self._settings.gauges.noise_mm * self._random.standard_normal(3)
        self._encoder_noise = self._settings.encoders.noise * self._random.standard_normal(self._legs)

    def _update(self) -> float:
        """Move the platform along the path of the joints since the last update."""
        now = self._clock.now()
        position = self._motion.path_position(now)
        while self._rows_passed + 1 <= position:
            self._rows_passed += 1
            self._move_platform(self._motion.path[self._rows_passed])
        (before, after), share = self._unseen, self._motion.fraction(now)
        # How far the joints are from where their encoders see them changes with a motion.
        self._move_platform(self._motion.joints(now), (1.0 - share) * before + share * after)
        return now

    def _move_platform(self, encoders: Array, beside: Array | None = None) -> None:
        """Move the platform as the encoders go straight to a place, and joints ``beside`` them."""
        joints = self._backlash.follow(encoders)
        if beside is not None:
            joints = joints + beside
        warmer_k = self._machine.warmer_k(self._clock.now() - self._start_s)
        if np.array_equal(joints, self._joints) and warmer_k == self._warmer_k:
            return
        self._joints, self._warmer_k = joints, warmer_k
        found = self._machine.pose(joints, warmer_k, self._pose)
        if found.found[0]:
            self._pose = found.poses
        # Otherwise the platform is at a singularity. Where a real one would go is unknown; this one
        # waits until the joints are where it can continue from its pose.

    def _ringing(self, since_s: float) -> Array:
        motion = self._settings.motion
        decay = np.exp(-since_s / motion.ringing_s) * np.cos(2.0 * np.pi * RINGING_HZ * since_s)
        direction = self._ringing_direction
        return np.asarray(motion.ringing_mm * decay * direction / np.linalg.norm(direction))
