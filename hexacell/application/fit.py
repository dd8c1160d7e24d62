"""An identification without a run: a cell and a measurement file."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.cell.loader import Cell
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.reporting.assessment import Assessment, assess
from hexacell.robot_model import robot_of


@dataclass(frozen=True, slots=True)
class FitResult:
    """An identified geometry beside the drawing, and how far it can be trusted."""

    identified: Identification
    drawing: Geometry
    assessed: Assessment

    @property
    def is_usable(self) -> bool:
        """Whether the solver converged and nothing refuses the result."""
        return self.identified.converged and not self.assessed.refused


def fit_measurements(cell: Cell, measurements: MeasurementSet) -> FitResult:
    """Identify the geometry of a cell's robot from records.

    Raises:
        IdentifiabilityError: the records cannot determine it.
        FileError: the controller's config cannot be read.
    """
    robot = robot_of(cell)
    identified = identify(robot.problem(measurements))
    assessed = assess(cell.settings, robot, measurements, identified)
    return FitResult(identified, robot.drawing, assessed)
