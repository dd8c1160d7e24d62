"""How simulated sliders go from one place to another: smoothly, and stoppable on the way.

The hidden truth of a simulated cell: where sliders and ball really are, and who sees what.
# MERGED-DOC
Sliders follow the motion they are given; the ball follows the true geometry, continued from where
it was, so that the platform stays on its assembly mode. Gauges and encoders look through noise.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.errors import ReachError
from hexacell.kinematics import rotations
from hexacell.kinematics.commanded_motion import change_geometry
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A path through joint vectors, timed by a smooth step.

    Attributes:
        path: (k, 6), mm, evenly spaced along the way.
        begins_s: on the cell's clock.
        duration_s: from rest to rest.
        stopped_s: when it was cut short.
    """

    path: Array
    start_s: float
    duration_s: float
    stopped_s: float = np.inf

    @classmethod
    def stationary(cls, joints: Array) -> Motion:
        """No motion: sliders standing at (6,), mm, for ever."""
        return cls(np.stack([joints, joints]), -1e9, 0.0)

    @property
    def end_s(self) -> float:
        """When the sliders stand again."""
        return min(self.start_s + self.duration_s, self.stopped_s)

    def fraction(self, now_s: float) -> float:
        """How much of the way is done, 0 to 1."""
        elapsed = min(now_s, self.stopped_s) - self.start_s
        t = 1.0 if elapsed >= self.duration_s else max(0.0, elapsed / self.duration_s)
        return t * t * (3.0 - 2.0 * t)

    def path_position(self, now_s: float) -> float:
        """Where on the path the sliders are, in rows of it."""
        return self.fraction(now_s) * (len(self.path) - 1)

    def joints(self, now_s: float) -> Array:
        """Slider positions (6,), mm, at a time."""
        place = self.path_position(now_s)
        below = min(int(place), len(self.path) - 2)
        share = place - below
        joints: Array = (1.0 - share) * self.path[below] + share * self.path[below + 1]
        return joints


AXES = "xyz"
RINGING_HZ = 8.0


class RobotPhysics:
    """The truth of one cell; safe to ask from several threads.

    ``on_travel`` is called whenever a move has begun; it must not take long.

    Raises:
        ReachError: the true geometry cannot stand where it should begin.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: SimulationSettings,
        clock: CellClock,
        *,
        start: PoseBatch,
        start_geometry: Geometry,
        start_joints: Array,
    ) -> None:
        values = settings.geometry
        self._truth = Geometry(values.S, values.B, values.l)
        self._mechanism = mechanism
        self.on_motion_start: Callable[[], None] = lambda: None
        self._settings = settings
        self._clock = clock
        self._random = np.random.default_rng(settings.seed)
        self._lock = threading.RLock()
        self._motion = Motion.stationary(start_joints)
        self._joints = start_joints
        self._passed = 0
        first = change_geometry(mechanism, start_geometry, self._truth, start, start_joints[None])
        if not first.found[0]:
            raise ReachError(
                f"the simulated machine cannot stand at {start.pose(0)}",
                action="Correct [simulation.geometry], or begin at another point",
            )
        self._pose = first.poses
        self._station = self._placed(self._pose.positions[0])
        self._triad = self._turned()
        self._disturb()

    def start_motion(self, path: Array) -> Motion:
        """Send the sliders along a path (k, 6), mm, that begins where they stand; returns at once."""
        motion = self._settings.motion
        with self._lock:
            longest = float(np.abs(np.diff(path, axis=0)).sum(axis=0).max())
            scatter = motion.repeatability_mm * self._random.standard_normal(6)
            really = path + np.linspace(0.0, 1.0, len(path))[:, None] * scatter
            really[0] = self._motion.joints(self._catch_up())
            duration = max(motion.minimum_s, longest / motion.speed_mm_s)
            self._motion, self._passed = Motion(really, self._clock.now(), duration), 0
            self._disturb()
            self.on_motion_start()
            return self._motion

    def stop(self) -> None:
        """Stop the sliders where they are."""
        with self._lock:
            now = self._clock.now()
            if now < self._motion.end_s:
                self._motion = replace(self._motion, stopped_s=now)

    @property
    def motion_end_s(self) -> float:
        """When the sliders came, or will come, to rest, on the cell's clock."""
        with self._lock:
            return self._motion.end_s

    def progress(self) -> float:
        """How much of the last way is done, 0 to 1."""
        with self._lock:
            return self._motion.fraction(self._clock.now())

    def encoder_positions(self) -> Array:
        """What the encoders see (6,), mm."""
        with self._lock:
            flicker = self._settings.encoders.flicker_mm * self._random.standard_normal(6)
            return self._motion.joints(self._clock.now()) + self._encoder_noise + flicker

    def gauge_displacement(self, axis: str) -> float:
        """What a gauge sees: the ball's way along its axis from the middle of its travel, mm."""
        with self._lock:
            ball = self._ball()
            seen = self._triad @ (ball - self._station) + self._gauge_noise
            flicker = self._settings.gauges.flicker_mm * self._random.standard_normal()
            return float(seen[AXES.index(axis)] + flicker)

    def _ball(self) -> Array:
        now = self._catch_up()
        ball: Array = self._pose.positions[0]
        if now >= self._motion.end_s:
            ball = ball + self._swinging(now - self._motion.end_s)
            if np.linalg.norm(ball - self._station) > self._settings.station_reach_mm:
                self._station, self._triad = self._placed(ball), self._turned()
        return ball

    def _disturb(self) -> None:
        self._swing = self._random.standard_normal(3)
        self._gauge_noise = self._settings.gauges.noise_mm * self._random.standard_normal(3)
        self._encoder_noise = self._settings.encoders.noise_mm * self._random.standard_normal(6)

    def _catch_up(self) -> float:
        """Bring the platform along the way the sliders have gone since it was last looked at."""
        now = self._clock.now()
        place = self._motion.path_position(now)
        while self._passed + 1 <= place:
            self._passed += 1
            self._follow(self._motion.path[self._passed])
        self._follow(self._motion.joints(now))
        return now

    def _follow(self, joints: Array) -> None:
        if np.array_equal(joints, self._joints):
            return
        found = forward_kinematics(self._mechanism, self._truth, joints[None], self._pose)
        self._joints = joints
        if found.found[0]:
            self._pose = found.poses
        # Else: a platform driven into a singularity. Where a real one would go nobody knows; this
        # one waits until the sliders are somewhere that it can follow from where it is.

    def _swinging(self, since_s: float) -> Array:
        motion = self._settings.motion
        decay = np.exp(-since_s / motion.ringing_s) * np.cos(2.0 * np.pi * RINGING_HZ * since_s)
        swinging: Array = motion.ringing_mm * decay * self._swing / np.linalg.norm(self._swing)
        return swinging

    def _placed(self, ball: Array) -> Array:
        return ball + self._settings.gauges.placing_mm * self._random.standard_normal(3)

    def _turned(self) -> Array:
        tilt = np.radians(self._settings.gauges.misalignment_deg)
        return rotations.from_vector(tilt * self._random.standard_normal(3))
