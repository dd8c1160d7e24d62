"""What joints and gauges may be off by, once it is measured how well the machine repeats.

What a cell file states is where a run starts. The joints of a machine that does not repeat stop elsewhere
each time; the encoders see it, and the gauges show it. A limit is therefore widened to what chance explains
by the scatter that was measured, unless the cell file says that it is fixed. A difference of the gauges at
one reference is compared only as far as the encoders do not explain it: what is left, beyond its noise and
what is not known of the geometry (:mod:`.ball_by_encoders`), is a gauge that slipped, or something that
moved.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.design.predicted_records import CHANCE_SIGMAS
from hexacell.distributions import chi_square_exceedance, normal_probability, student_limit
from hexacell.errors import LimitError
from hexacell.identification.solver.result import Identification
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.kinematics.parameters import CONSTRAINTS
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.noise.ball_by_encoders import BallByEncoders
from hexacell.robot.model import Robot
from hexacell.robot.stated import gauge_travel_of

SIGMAS = 5.0
"""Standard deviations up to which a difference is chance, at some hundred stops of six joints each."""

UNCHANGED = 0.05
"""Probability by noise below which gauges may have been moved meanwhile: along each axis alone they may
differ by no more than chance, where encoders hardly tell how the ball moved, and yet by nothing that joints
could do. To measure a set again in vain costs minutes, gauges that were moved unnoticed the result."""

DENIED = 3.0
"""Standard deviations by which gauges must contradict an encoder that shows more than chance."""

SCATTER = 1.5
"""Noise of the encoders over what is stated from which the ball may leave the travel by chance."""

CHANCE_SHARE = 0.9
"""Share of the gauges' room that chance may take: beyond, no pose could be measured."""

ROOM_KEPT = 0.5
"""Share of the gauges' room that a plunger has left on either side when the gauges are zeroed."""


@dataclass(frozen=True, eq=False)
class Allowances:
    """What may be off at a stop, at a standstill or back at a reference.

    ``robot`` has the geometry that its controller has, and the noise of a record as known by now, which may
    have been measured; ``found`` is what was identified, once it was.
    """

    settings: CellSettings
    robot: Robot
    is_measured: bool = False
    found: Identification | None = None

    @cached_property
    def terms(self) -> TermEstimates | None:
        """What is known beside the geometry, by this run or, in a check, by the calibration before it."""
        return self.robot.belief(self.found).terms

    @property
    def stops(self) -> float:
        """One standard deviation of where a joint stops, as its encoder shows it, as far as measured."""
        return self.robot.noise.stops

    @property
    def stop_sigmas(self) -> float:
        """``SIGMAS`` of the stops, and more where few visits have measured how large one is."""
        visits = self.settings.noise.revisits
        if not self.is_measured or not visits or self.stops <= self.settings.noise.stops:
            return SIGMAS
        return student_limit(
            self.robot.mechanism.joint_count * visits, float(normal_probability(np.array(-SIGMAS)))
        )

    @property
    def scatters(self) -> bool:
        """Whether it was measured that the machine does not repeat, beyond what is stated of a record."""
        stated = self.settings.noise.encoder
        return self.is_measured and (self.stops > stated or self.robot.noise.encoder > SCATTER * stated)

    @cached_property
    def following(self) -> float:
        """How far a joint may stop from its command, in its unit.

        Until the scatter is measured, as far as the gauges can follow the ball.
        """
        guards, wanted = self.settings.guards, self.settings.noise
        if guards.limits == "fixed":
            return guards.following
        stated = max(guards.following, self.stop_sigmas * self.stops)
        if self.is_measured or not wanted.revisits:
            return stated
        ball = self.ball_at(Pose(*self.settings.identification.points[0]))
        room = gauge_travel_of(self.settings).sure_room.smallest_mm
        return max(stated, room / float(np.linalg.norm(ball.by_joints, axis=0).max()))

    def since(
        self, reference: Pose, before: Array, now: Array, unknown: Array | None = None, readings: float = 0
    ) -> "ReferenceChange":
        """The change of two readings (9,) at one reference: gauges x, y, z, mm, then the encoders.

        ``unknown`` is how far each joint (6,) may be from where it was taken to be in both together. The
        second one is so many ``readings`` later, or in the time of so many, while the gauges drift as is
        known of them.
        """
        ball, change = self.ball_at(reference, before[3:]), now - before
        joints, noise = change[3:], self.robot.noise
        readings_covariance = 2.0 * noise.record_covariance(ball.by_joints[None])[0]
        covariance = readings_covariance + ball.covariance(joints)
        is_fixed = self.settings.guards.limits == "fixed"
        by_drift = readings * noise.walk.step_mm**2 * np.eye(3)
        explicable = SIGMAS * np.sqrt(np.diag(covariance + by_drift))
        unknown = np.zeros(len(joints)) if unknown is None else unknown
        unexplained, sides = change[:3] - ball.motion(joints), ball.by_joints * unknown
        whole = covariance + by_drift + sides @ sides.T
        explicable = explicable + np.abs(ball.by_joints) @ unknown
        chance = float(np.sqrt(2.0)) * self.stop_sigmas * np.hypot(noise.encoders, self.stops) + unknown
        is_known = self.is_measured or not self.settings.noise.revisits
        return ReferenceChange(
            unexplained_mm=unexplained,
            covariance=covariance,
            by_stops=2.0 * ball.by_joints @ ball.by_joints.T,
            explicable_mm=np.zeros(3) if is_fixed else explicable,
            joints=joints,
            explicable_joints=0.0 if is_fixed else float(np.sqrt(2.0)) * self.stop_sigmas * self.stops,
            readings=readings,
            by_joints=ball.by_joints,
            chance_joints=chance if is_known else np.full(len(joints), np.inf),
            at_rest=readings_covariance + ball.covariance(joints - np.diag(joints)),
            by_drift=by_drift,
            probability=chi_square_exceedance(
                3.0, float(unexplained @ np.linalg.solve(whole, unexplained))
            ),
        )

    def between_visits(self, reference: Pose, visits: Array) -> "tuple[ReferenceChange, ...]":
        """The changes between m visits (m, 9) of one reference, as m - 1 that are independent."""
        return tuple(self.since(reference, np.zeros_like(one), one) for one in contrasts(visits))

    def mounting_mm(self, reference: Pose) -> Array:
        """How far each plunger (3,) may stand from the middle of its travel when the gauges are zeroed.

        Fixed gauges are where the machine has once been; no person can bring them nearer, and half of
        their room is enough.
        """
        stated = self.settings.stations.mounting_mm
        kept = ROOM_KEPT * gauge_travel_of(self.settings).room().smallest_mm
        if self.settings.guards.limits == "fixed":
            return np.full(3, stated)
        if self.settings.stations.placement == "fixed":
            return np.full(3, max(stated, kept))
        scatter = self.stops * np.linalg.norm(self.ball_at(reference).by_joints, axis=1)
        return np.asarray(np.maximum(stated, np.minimum(self.stop_sigmas * scatter, kept)))

    def require_travel(self, reference: Pose) -> None:
        """Require gauges in which the ball stays by chance, if it is not moved at all.

        Raises:
            LimitError: the machine scatters so much that no pose keeps it there.
        """
        by_joints, noise = self.ball_at(reference).by_joints[None], self.robot.noise
        chance = noise.record_covariance(by_joints)[0] + noise.chance_covariance(by_joints)[0]
        needed = 2.0 * CHANCE_SIGMAS * float(np.sqrt(np.diag(chance).max())) / CHANCE_SHARE
        gauges, limits = self.settings.gauges, self.settings.limits
        travel = min(2.0 * limits.gauge_travel_mm, *(gauge.travel_mm for gauge in gauges))
        if needed > travel:
            raise LimitError(
                f"this machine does not repeat well enough for gauges of {travel:g} mm: the ball leaves "
                "their travel by chance, wherever it is",
                action=f"Use gauges with a travel of more than {needed:.0f} mm, and state it in "
                "gauges.travel_mm and limits.gauge_travel_mm; or look for play in guides and joints",
            )

    def ball_at(self, reference: Pose, shown: Array | None = None) -> BallByEncoders:
        """How the ball moves near a reference by the encoders, which have ``shown`` (6,) there."""
        robot = self.robot
        return BallByEncoders.at(robot, robot.belief(self.found), robot.from_commands([reference]), shown)


def contrasts(rows: Array) -> Array:
    """Differences (m - 1, k) of m rows (m, k) alike, that are independent, each of two rows' variance."""
    return np.array(
        [np.sqrt(2.0 * k / (k + 1.0)) * (rows[:k].mean(axis=0) - rows[k]) for k in range(1, len(rows))]
    )


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceChange:
    """How two readings at one reference differ.

    Attributes:
        unexplained_mm: (3,) of the gauges x, y, z, less what the encoders show of it.
        covariance: (3, 3), mm^2, of that, by noise and an uncertain geometry.
        by_stops: (3, 3), mm^2, by joints that stop one unit beside what their encoders show.
        explicable_mm: (3,) up to which these explain it.
        joints: (6,) of the encoders.
        explicable_joints: up to which the scatter of the stops explains these.
        readings: how many later the second one is, or in the mean time of how many, where times are known;
            0 of visits one after the other.
        by_joints: (3, 6) derivative of the ball's position, mm by the joints' unit.
        chance_joints: (6,) up to which an encoder that did not slip may differ.
        at_rest: (6, 3, 3), mm^2, the ``covariance`` if that leg did not move, whatever its encoder shows.
        by_drift: (3, 3), mm^2, that the known drift of the gauges adds to the ``covariance``.
        probability: of as much, by all this.
    """

    unexplained_mm: Array
    covariance: Array
    by_stops: Array
    explicable_mm: Array
    joints: Array
    explicable_joints: float
    readings: float = 0
    by_joints: Array = field(default_factory=lambda: np.zeros((3, CONSTRAINTS)))
    chance_joints: Array = field(default_factory=lambda: np.full(CONSTRAINTS, np.inf))
    at_rest: Array = field(default_factory=lambda: np.zeros((CONSTRAINTS, 3, 3)))
    by_drift: Array = field(default_factory=lambda: np.zeros((3, 3)))
    probability: float = 1.0

    def exceeds(self, limit_mm: float) -> bool:
        """Whether a gauge shows more than a limit, and more than is explicable."""
        return bool((np.abs(self.unexplained_mm) > np.maximum(limit_mm, self.explicable_mm)).any())

    def is_unlikely(self, limit_mm: float) -> bool:
        """Whether a gauge shows more than a limit, and all three together what chance hardly explains."""
        return bool((np.abs(self.unexplained_mm) > limit_mm).any()) and self.probability < UNCHANGED

    def leg_beyond(self, limit: float) -> int | None:
        """The leg, from 0, whose encoder shows most, beyond a limit and what is explicable; or None."""
        leg = int(np.abs(self.joints).argmax())
        return leg if abs(self.joints[leg]) > max(limit, self.explicable_joints) else None

    def slipped_encoder(self) -> int | None:
        """The leg, from 0, whose encoder shows more than chance, and the gauges deny it; None if none does.

        A joint that stopped elsewhere takes the ball along, as far as the geometry is known. Where only the
        encoder changed, the gauges lack exactly the share of that joint: the likelihoods are compared.
        """

        def unlikelihood(unexplained: Array, covariance: Array) -> float:
            whole = covariance + self.by_drift
            return float(unexplained @ np.linalg.solve(whole, unexplained) + np.linalg.slogdet(whole)[1])

        beyond: list[int] = np.flatnonzero(np.abs(self.joints) > self.chance_joints).tolist()
        if not beyond:
            return None
        shares = self.by_joints * self.joints
        slips = [unlikelihood(self.unexplained_mm + shares[:, leg], self.at_rest[leg]) for leg in beyond]
        best = int(np.argmin(slips))
        is_denied = unlikelihood(self.unexplained_mm, self.covariance) - slips[best] > DENIED**2
        return beyond[best] if is_denied else None
