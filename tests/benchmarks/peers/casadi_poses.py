"""An expert's formulation in CasADi: poses and true joints are unknowns, legs are constraints, by IPOPT.

Readings of encoders and gauges are weighted by their noise, derivatives of first and second order are exact
and sparse. Building the expressions is part of the time, since every set of records has its own.
"""

from typing import Any

import casadi
import numpy as np

from hexacell.kinematics.rotations import Array
from tests.benchmarks.peers.robots import Records

OPTIONS: dict[str, Any] = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": 0,
    "ipopt.tol": 1e-9,
    "ipopt.max_iter": 300,
}


def solve(records: Records) -> Array:
    """See the module."""
    free = casadi.SX.sym("free", records.basis.shape[1])
    geometry = casadi.DM(records.basis) @ free
    zeros = casadi.SX.sym("zeros", 3, len(records.first_positions))
    unknowns, start = [free, casadi.vec(zeros)], [records.free, records.first_positions.ravel()]
    cost, legs = casadi.SX(0), []
    for row, point in enumerate(records.points):
        position, turn, joints = (
            casadi.SX.sym(f"{name}{row}", size) for name, size in (("P", 3), ("w", 3), ("q", 6))
        )
        rotation = _rotation_of(turn) @ casadi.DM(records.rotations[row])
        legs.append(_closed_legs(geometry, position, rotation, joints))
        gauge = position - zeros[:, int(point)] - casadi.DM(records.deviations[row])
        encoder = joints - casadi.DM(records.joints[row])
        cost += casadi.sumsqr(gauge) / records.gauge_mm**2 + casadi.sumsqr(encoder) / records.encoder_mm**2
        unknowns += [position, turn, joints]
        start += [records.positions[row], np.zeros(3), records.joints[row]]
    program = {"x": casadi.vertcat(*unknowns), "f": cost / 2.0, "g": casadi.vertcat(*legs)}
    solver = casadi.nlpsol("peer", "ipopt", program, OPTIONS)
    found = solver(x0=np.concatenate(start), lbg=0.0, ubg=0.0)
    if not solver.stats()["success"]:
        raise ArithmeticError(solver.stats()["return_status"])
    result: Array = records.basis @ np.asarray(found["x"]).ravel()[: records.basis.shape[1]]
    return result


def _closed_legs(geometry: Any, position: Any, rotation: Any, joints: Any) -> Any:
    S, B = (casadi.reshape(geometry[part], 3, 6) for part in (slice(0, 18), slice(18, 36)))
    legs = S - casadi.repmat(position, 1, 6) - rotation @ B
    legs[0, :] += joints.T
    lengths = geometry[36:]
    return (casadi.sum1(legs**2).T - lengths**2) / (2.0 * lengths)


def _rotation_of(turn: Any) -> Any:
    square = casadi.sumsqr(turn) + 1e-30
    angle, k = casadi.sqrt(square), casadi.skew(turn)
    return casadi.SX.eye(3) + casadi.sin(angle) / angle * k + (1 - casadi.cos(angle)) / square * (k @ k)
