"""The same in Ceres (pyceres) as a bundle adjustment: poses are unknowns, encoders see inverse kinematics.

Each record is one residual block of nine numbers, weighted by the noise, with the derivatives by hand; the
poses are eliminated by Ceres' Schur complement.
"""

from typing import Any

import numpy as np
import pyceres

from hexacell.kinematics.rotations import Array, from_vector, skew
from tests.benchmarks.peers.robots import Records

MOST_ITERATIONS = 300


class _Record(pyceres.CostFunction):  # type: ignore[misc]
    """Nine residuals by the free parameters, the point's zero, the position and a turn from the command."""

    def __init__(self, records: Records, row: int) -> None:
        super().__init__()
        self._records, self._row = records, row
        self.set_num_residuals(9)
        self.set_parameter_block_sizes([records.basis.shape[1], 3, 3, 3])

    def Evaluate(self, parameters: Any, residuals: Any, jacobians: Any) -> bool:  # Ceres' own name
        records, row = self._records, self._row
        free, zero, position, turn = (np.asarray(block) for block in parameters)
        geometry = records.basis @ free
        S, B, lengths = geometry[:18].reshape(6, 3), geometry[18:36].reshape(6, 3), geometry[36:]
        rotation = from_vector(turn) @ records.rotations[row]
        arms = B @ rotation.T
        legs = S - position - arms
        square = lengths**2 - legs[:, 1] ** 2 - legs[:, 2] ** 2
        if square.min() <= 0.0:
            return False
        along = records.branch * np.sqrt(square)
        residuals[:6] = (along - legs[:, 0] - records.joints[row]) / records.encoder_mm
        residuals[6:] = (position - zero - records.deviations[row]) / records.gauge_mm
        if jacobians is not None:
            legs[:, 0] = along
            self._derive(jacobians, legs / along[:, None], arms, rotation, lengths / along, turn)
        return True

    def _derive(
        self, jacobians: Any, n: Array, arms: Array, rotation: Array, by_length: Array, turn: Array
    ) -> None:
        """``n``: the legs (6, 3) over their parts along the rails, so that a slider's part is 1."""
        records = self._records
        legs = range(6)
        by_geometry = np.zeros((6, 42))
        for leg in legs:
            by_geometry[leg, 3 * leg : 3 * leg + 3] = -n[leg]
            by_geometry[leg, 18 + 3 * leg : 21 + 3 * leg] = n[leg] @ rotation
            by_geometry[leg, 36 + leg] = by_length[leg]
        by_turn = np.stack([-n[leg] @ skew(arms[leg]) for leg in legs]) @ _left_jacobian(turn)
        gauge, nothing = np.eye(3) / records.gauge_mm, np.zeros((3, 3))
        blocks = (
            np.vstack(
                [by_geometry @ records.basis / records.encoder_mm, np.zeros((3, records.basis.shape[1]))]
            ),
            np.vstack([np.zeros((6, 3)), -gauge]),
            np.vstack([n / records.encoder_mm, gauge]),
            np.vstack([by_turn / records.encoder_mm, nothing]),
        )
        for wanted, block in zip(jacobians, blocks, strict=True):
            if wanted is not None:
                wanted[:] = block.ravel()


def _left_jacobian(vector: Array) -> Array:
    """(3, 3) from a change of a rotation vector (3,) to the turn in the base frame that it makes."""
    angle = float(np.linalg.norm(vector))
    k = skew(vector)
    if angle < 1e-6:
        return np.eye(3) + 0.5 * k
    linear = (1.0 - np.cos(angle)) / angle**2
    square = (angle - np.sin(angle)) / angle**3
    result: Array = np.eye(3) + linear * k + square * (k @ k)
    return result


def solve(records: Records) -> Array:
    """See the module."""
    free = records.free.copy()
    zeros = [zero.copy() for zero in records.first_positions]
    poses = [(position.copy(), np.zeros(3)) for position in records.positions]
    problem = pyceres.Problem()
    costs = [_Record(records, row) for row in range(len(records.points))]
    for cost, point, pose in zip(costs, records.points, poses, strict=True):
        problem.add_residual_block(cost, None, [free, zeros[point], *pose])
    options, summary = pyceres.SolverOptions(), pyceres.SolverSummary()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_SCHUR
    options.max_num_iterations = MOST_ITERATIONS
    options.function_tolerance = options.parameter_tolerance = 1e-12
    options.num_threads = 1  # the residuals are Python
    options.minimizer_progress_to_stdout = False
    pyceres.solve(options, problem, summary)
    if summary.termination_type != pyceres.TerminationType.CONVERGENCE:
        raise ArithmeticError(summary.BriefReport())
    geometry: Array = records.basis @ free
    return geometry
