"""Constraints and derivatives of each mechanism, against its leg equation written for the tests alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.mechanisms.gough_stewart import GoughStewart
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.mechanisms.rotary_cranks import RotaryCranks
from hexacell.kinematics.mechanisms.six_rails import SixRails
from hexacell.kinematics.pose import Pose, PoseBatch

STEP = 1e-30  # complex steps need no compromise between rounding and truncation
place, degrees = st.floats(-100.0, 100.0), st.floats(-25.0, 25.0)
poses = st.builds(Pose, place, place, st.floats(-50.0, 50.0), degrees, degrees, degrees)
Numbers = dict[str, Any]


def ring(radius: float, height: float, angles: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    exact = [[radius * np.cos(a), radius * np.sin(a), height] for a in np.radians(angles)]
    return np.array(exact) + random.uniform(-3.0, 3.0, (6, 3))


def turned_z(turns: np.ndarray) -> np.ndarray:
    """Where turns (6, 2) about x and y put the z axis, of complex numbers."""
    angle = np.sqrt(turns[:, 0] ** 2 + turns[:, 1] ** 2)
    sine = np.sin(angle) / angle
    return np.stack([turns[:, 1] * sine, -turns[:, 0] * sine, np.cos(angle)], axis=1)


def turned(turns: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Where these turns put another axis (3,): Rodrigues."""
    angle = np.sqrt(turns[:, 0] ** 2 + turns[:, 1] ** 2)
    k = np.stack([turns[:, 0], turns[:, 1], 0.0 * angle], axis=1) / angle[:, None]
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.asarray(axis * cosine + np.cross(k, axis) * sine + k * (k @ axis)[:, None] * (1.0 - cosine))


def on_cranks(n: Numbers) -> np.ndarray:
    angle = ((n["zero"] + n["joints"]) * np.pi / 180.0)[:, None]
    x, y = (turned(n["axis"], axis) for axis in np.eye(3)[:2])
    return np.asarray(n["centre"] + n["crank"][:, None] * (x * np.cos(angle) + y * np.sin(angle)))


@dataclass(frozen=True)
class Machine:
    """A robot, where the legs' ends at the base are, and what a constraint is of a leg's vector."""

    mechanism: Mechanism
    branch: Branch
    numbers: Numbers
    middle: float
    platform: str
    base_ends: Callable[[Numbers], np.ndarray]
    error: Callable[[np.ndarray, Numbers], np.ndarray]

    def errors(self, numbers: Numbers) -> np.ndarray:
        """Constraints of the legs (6,), of complex numbers."""
        x, y, z = numbers["turn"]
        small_turn = np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        ends = numbers["position"] + numbers[self.platform] @ (small_turn @ numbers["rotation"]).T
        leg = self.base_ends(numbers) - ends
        return self.error(np.sum(leg * leg, axis=1), numbers)

    def by_complex_step(self, numbers: Numbers, name: str, place: tuple[int, ...]) -> np.ndarray:
        stepped = {key: np.asarray(value, dtype=complex).copy() for key, value in numbers.items()}
        stepped[name][place] += 1j * STEP
        return np.asarray(self.errors(stepped).imag / STEP)


def machines() -> list[Machine]:
    random = np.random.default_rng(3)
    base = ring(600, 0, (200, 220, 320, 340, 80, 100), random)
    platform = ring(180, -60, (165, 255, 285, 15, 45, 135), random)
    wide = np.array([[side * 60.0, y, -120.0] for side in (-1, 1) for y in (-60.0, 0.0, 60.0)])
    lengths = 800.0 + random.uniform(-3.0, 3.0, 6)
    turns = random.uniform(-0.2, 0.2, (6, 2))
    up: Branch = (1, 1, 1, 1, 1, 1)
    along_x = np.array([1.0, 0.0, 0.0])
    return [
        Machine(
            Hexaglide(),
            (-1, -1, -1, 1, 1, 1),
            {"S": wide * (0.0, 2.5, 0.0) + random.uniform(-3, 3, (6, 3)), "B": wide, "l": lengths - 200.0},
            550.0,
            "B",
            lambda n: n["S"] + n["joints"][:, None] * along_x,
            lambda squared, n: (squared - n["l"] ** 2) / (2.0 * n["l"]),
        ),
        Machine(
            GoughStewart(),
            (),
            {"base": base, "platform": platform, "offset": random.uniform(-20.0, 600.0, 6)},
            750.0,
            "platform",
            lambda n: n["base"],
            lambda squared, n: np.sqrt(squared) - n["offset"] - n["joints"],
        ),
        Machine(
            SixRails(),
            up,
            {"S": base, "rail": turns, "B": platform, "l": lengths},
            350.0,
            "B",
            lambda n: n["S"] + n["joints"][:, None] * turned_z(n["rail"]),
            lambda squared, n: np.sqrt(squared) - n["l"],
        ),
        Machine(
            RotaryCranks(),
            up,
            {
                "centre": base / 2.0,
                "axis": turns + np.array([1.2, 0.0]),
                "crank": np.full(6, 120.0) + random.uniform(-3.0, 3.0, 6),
                "zero": random.uniform(-20.0, 20.0, 6),
                "platform": platform,
                "rod": lengths - 200.0,
            },
            500.0,
            "platform",
            on_cranks,
            lambda squared, n: np.sqrt(squared) - n["rod"],
        ),
    ]


@pytest.mark.parametrize("machine", machines(), ids=lambda machine: machine.mechanism.name)
@given(poses, st.floats(-5.0, 5.0))
def test_constraints_and_derivatives_are_those_of_the_leg_equation(machine, pose, off) -> None:
    """Also where the legs do not close: the solver linearises there."""
    mechanism, batch = machine.mechanism, PoseBatch.of([pose])
    batch = PoseBatch(batch.positions + np.array([0.0, 0.0, machine.middle]), batch.rotations)
    geometry = Geometry.of(mechanism.parameters, machine.numbers)
    joints = mechanism.inverse(geometry, machine.branch, batch) + off
    if np.isnan(joints).any():
        return
    state = {**machine.numbers, "joints": joints[0], "position": batch.positions[0]}
    state |= {"turn": np.zeros(3), "rotation": batch.rotations[0]}
    found = mechanism.derivatives(geometry, batch, joints)
    residual, jacobian = mechanism.residual_and_jacobian(geometry, batch, joints)
    np.testing.assert_allclose(residual[0], machine.errors(state), atol=1e-11)
    np.testing.assert_allclose(jacobian, found.pose, atol=1e-12)
    for axis in range(3):
        by_position = machine.by_complex_step(state, "position", (axis,))
        np.testing.assert_allclose(found.pose[0, :, axis], by_position, atol=1e-12)
        by_turn = machine.by_complex_step(state, "turn", (axis,))
        np.testing.assert_allclose(found.pose[0, :, 3 + axis], by_turn, atol=1e-10)
    for leg in range(6):
        places = [
            (kind.symbol, (leg, *component))
            for kind in mechanism.parameters.kinds
            for component in np.ndindex(kind.shape[1:])
        ]
        derivatives = np.array(
            [machine.by_complex_step(state, *each) for each in [("joints", (leg,)), *places]]
        )
        told = [found.joints[0, leg], *found.parameters[0, leg]]
        np.testing.assert_allclose(derivatives[:, leg], told, rtol=1e-11, atol=1e-10)
        # That leg's numbers move no other leg, so nothing is missing from the compact form.
        assert not np.delete(derivatives, leg, axis=1).any()
