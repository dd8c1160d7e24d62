"""What a simulated machine does that is not its geometry: backlash, play, compliance, expansion.

All of it is from the physics, and nothing from what identifies it.

- **Backlash**: a joint is dragged by its encoder at either end of a gap, and stays where it is within.
- **Forces** of the legs hold the platform's weight. A leg can only pull or push along the line through its
  two joints, so that six forces along the six lines are in balance with the weight.
- **Play**: a leg that is pulled is longer by half of it, one that is pushed shorter. Where the force is
  less than ``SEATED_N`` it lies between, so that the pose is a function of joints and temperature.
- **Compliance**: a leg is longer in proportion to its force.
- **Expansion**: lengths of a part grow with its temperature. The scale of a linear encoder grows with the
  base: the joint goes farther for what it shows. Angles do not change.

Forces change lengths, lengths the pose and the pose the forces: a fixed-point iteration. A leg becomes
longer by its length among the mechanism's parameters, which is exact; where a mechanism has none, by the
change of its joint variable that does the same to its constraint, to first order.

Sources: Visintin, Differential Models of Hysteresis, 1994 (play operator); Merlet, Parallel Robots, 2nd ed.
2006, ch. 9 (statics).
"""

import numpy as np

from hexacell.cell.simulation import SimulatedLoad, SimulationSettings
from hexacell.kinematics.forward import ForwardResult, forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import JointUnit, MachinePart
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

SEATED_N = 0.5
"""Force from which on a leg with play lies at one end of it, N."""

MOST_ROUNDS = 60
BALANCED_MM = 1e-9
"""Change of a leg's length below which forces and lengths agree."""

UM = 1e-3
"""A micrometre in mm."""


class Backlash:
    """Where six joints are that lag behind their encoders; it depends on the way there."""

    def __init__(self, gaps: Array, joints: Array, random: np.random.Generator) -> None:
        """Where the joints came from at first is unknown: they are anywhere in their gaps."""
        self._half = 0.5 * gaps
        self._joints = joints + self._half * random.uniform(-1.0, 1.0, len(joints))

    def follow(self, encoders: Array) -> Array:
        """The joints (6,) after their encoders have gone straight from where they were to a place."""
        self._joints = np.clip(self._joints, encoders - self._half, encoders + self._half)
        return self._joints


class LoadedMachine:
    """The pose of a machine by its joints and temperature, under its weight."""

    def __init__(self, mechanism: Mechanism, geometry: Geometry, settings: SimulationSettings) -> None:
        self._mechanism = mechanism
        self._geometry = geometry
        self._load, self._temperature = settings.load, settings.temperature
        self._play_mm = np.array(settings.legs.play_mm)
        self._mm_n = UM * np.array(settings.legs.compliance_um_n)
        self._yields = bool(settings.load.weight_n and (self._play_mm.any() or self._mm_n.any()))
        self._longer = np.zeros(mechanism.joint_count)

    def warmer_k(self, elapsed_s: float) -> float:
        """By how much the machine is warmer some time after its start."""
        return self._temperature.rise_k * min(1.0, elapsed_s / self._temperature.over_s)

    def pose(self, joints: Array, warmer_k: float, start: PoseBatch) -> ForwardResult:
        """The pose (1) at joint variables (6,), from a pose nearby."""
        geometry, joints = self._expanded(joints[None], warmer_k)
        if not self._yields:
            return forward_kinematics(self._mechanism, geometry, joints, start)
        longer, share, before = self._longer, 1.0, np.zeros_like(self._longer)
        for _ in range(MOST_ROUNDS):
            changed = with_longer_legs(self._mechanism, geometry, joints, start, longer)
            found = forward_kinematics(self._mechanism, *changed, start)
            if not found.found[0]:
                return found
            start = found.poses
            tension = leg_tensions(self._mechanism, geometry, start, joints, self._load)[0]
            seated = np.clip(tension / SEATED_N, -1.0, 1.0)
            step = np.asarray(0.5 * self._play_mm * seated + self._mm_n * tension) - longer
            if np.abs(step).max() < BALANCED_MM:
                break
            if before @ step < 0.0 and np.abs(step).max() > 0.5 * np.abs(before).max():
                share *= 0.5  # it swings about the balance
            before, longer = step, longer + share * step
        self._longer = longer
        return found

    def _expanded(self, joints: Array, warmer_k: float) -> tuple[Geometry, Array]:
        """The geometry of the warmer machine, and the joint variables where encoders show ``joints``."""
        if warmer_k == 0.0:
            return self._geometry, joints
        stated, parameters = self._temperature, self._mechanism.parameters
        growth = {
            MachinePart.BASE: 1e-6 * warmer_k * stated.expansion_base_um_m_k,
            MachinePart.PLATFORM: 1e-6 * warmer_k * stated.expansion_platform_um_m_k,
            MachinePart.LEGS: 1e-6 * warmer_k * stated.expansion_legs_um_m_k,
        }
        of_kinds = {kind.symbol: growth[kind.part] if kind.part else 0.0 for kind in parameters.kinds}
        grown, legs = parameters.by_kind(of_kinds), MachinePart.LEGS
        for row, one in enumerate(parameters.parameters):
            grown[row] *= stated.legs_share[one.leg - 1] if one.kind.part is legs else 1.0
        geometry = Geometry(parameters, self._geometry.vector * (1.0 + grown))
        is_linear = self._mechanism.words.joint_unit is JointUnit.MM
        return geometry, joints * (1.0 + growth[MachinePart.BASE]) if is_linear else joints


def leg_tensions(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array, load: SimulatedLoad
) -> Array:
    """Forces (n, 6) with which the legs pull at the platform, N, in balance with its weight."""
    legs = mechanism.legs(geometry, poses, joints)
    arms = legs.platform_joints - poses.positions[:, None, :]
    direction = np.array(load.direction)
    weight = load.weight_n * direction / np.linalg.norm(direction)
    pull = np.broadcast_to(weight, poses.positions.shape)
    centre = arms.mean(axis=1) if load.centre_mm is None else poses.rotations @ np.array(load.centre_mm)
    # Moments are about the ball. A leg that pulls draws the platform toward the base.
    lines = np.concatenate([legs.directions, np.cross(arms, legs.directions)], axis=-1)
    loads = np.concatenate([pull, np.cross(centre, pull)], axis=-1)
    # At a singularity legs cannot hold every weight; the pseudoinverse gives the forces nearest to that.
    return np.asarray(-(np.linalg.pinv(np.swapaxes(lines, -1, -2)) @ loads[..., None])[..., 0])


def with_longer_legs(
    mechanism: Mechanism, geometry: Geometry, joints: Array, poses: PoseBatch, longer: Array
) -> tuple[Geometry, Array]:
    """The geometry and the joint variables (n, 6) with legs longer by (6,), mm, near some poses."""
    parameters = mechanism.parameters
    lengths = [kind for kind in parameters.kinds if kind.part is MachinePart.LEGS and not kind.components]
    if lengths:
        changes = parameters.changes(lengths[0].symbol, longer[:, None])[:, 0]
        return Geometry(parameters, geometry.vector + changes), joints
    return geometry, joints - longer / mechanism.derivatives(geometry, poses, joints).joints
