"""Whether a drawing and a controller's config are of one robot, and of a robot at all.

A config differs from the drawing by the tolerances, and by what calibrations changed. If it differs by
more, another unit, or another order of the legs, may explain it: then that is what is said.
"""

from collections.abc import Iterator
from functools import partial
from itertools import permutations
from pathlib import Path

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.errors import FileError, UsageError
from hexacell.identification.problem.prior import Tolerances
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import MachinePart, ParameterUnit, each_of
from hexacell.kinematics.rotations import Array

FARTHEST_DRAWING = 0.25
"""Largest difference of the drawing from a config, as a share of the largest number of the config."""

TIMES_TOLERANCE = 3.0
"""Times the sum of the tolerances up to which a config differs from the drawing for the usual reasons."""

UNITS_MM = {"metres": 1000.0, "inches": 25.4, "micrometres": 1e-3}
"""What lengths may be stated in by mistake, mm."""

SAME_SHARE = 0.05
"""Largest difference of two sizes, as a share, that another unit leaves."""


def require_frames(mechanism: Mechanism, geometry: Geometry, path: Path, line: int | None = None) -> None:
    """Refuse a geometry whose joints do not fix a frame; raises ``FileError``."""
    try:
        mechanism.normalize_frames(geometry)
    except UsageError as error:
        problem = f"the geometry is no robot's: {error.problem}"
        raise FileError(problem, subject=path, line=line, action="Correct its joints") from error


def require_same_robot(cell: Cell, drawing: Geometry, controller: Geometry) -> None:
    """Refuse a drawing so far from the config that no calibration leads from one to the other.

    Raises:
        FileError: names the unit or the order of the legs that explains it, or the parameter that differs
            most.
    """
    mechanism, parameters = cell.settings.mechanism, cell.settings.mechanism.parameters
    drawn, commanding = _numbers(mechanism, drawing), _numbers(mechanism, controller)
    difference = np.abs(drawn - commanding)
    tolerances = Tolerances.of_settings(parameters, cell.settings.tolerances.model_dump())
    usual = TIMES_TOLERANCE * (tolerances.sum_mm(parameters) or np.inf)
    worst, largest = int(difference.argmax()), float(difference.max())
    is_another = largest > FARTHEST_DRAWING * np.abs(commanding).max()
    if not is_another and largest <= usual:
        return
    refused = partial(FileError, subject=cell.path, line=cell.document.line_of(("robot", "nominal")))
    if (order := _other_order(mechanism, drawing, controller, min(usual, largest / 4.0))) is not None:
        raise refused(
            f"the legs are in another order than in {cell.config_path}: {order}",
            action="List the legs in the same order in both files: leg 1 is that of encoder 1",
        )
    if not is_another:
        return
    for unit, size_mm in UNITS_MM.items():
        for scaled, whose in ((drawn, "[robot.nominal]"), (commanding, str(cell.config_path))):
            other = commanding if scaled is drawn else drawn
            if abs(np.linalg.norm(scaled) * size_mm / np.linalg.norm(other) - 1.0) < SAME_SHARE:
                raise refused(
                    f"the lengths in {whose} look like {unit}: in the other file they are {size_mm:g} "
                    "times as large",
                    action="Write millimetres, or state unit_mm in [controller.config_options]",
                )
    parameter = parameters.parameters[worst]
    name, unit = mechanism.convention.display_name(parameter.name), parameter.kind.unit.shown
    raise refused(
        f"the drawing is not of the robot in {cell.config_path}: {name} differs by {largest:.4g} {unit} "
        "once both are in the same frames",
        action="Correct [robot.nominal], or the config",
    )


def _numbers(mechanism: Mechanism, geometry: Geometry) -> Array:
    """The parameters (P,) in the convention's frames, in units that count as much as a millimetre."""
    return np.asarray(mechanism.normalize_frames(geometry)[0].vector / mechanism.parameters.like_a_mm)


def _other_order(
    mechanism: Mechanism, drawing: Geometry, controller: Geometry, largest_mm: float
) -> str | None:
    """The order of the config's legs, or of their joints on one part, that makes it agree; in words."""
    drawn = _numbers(mechanism, drawing)
    best, words = largest_mm, None
    for what, symbols in _parts(mechanism):
        for order in [*permutations(range(mechanism.joint_count))][1:]:
            try:
                numbers = _numbers(mechanism, reordered(controller, symbols, order))
            except UsageError:
                continue
            difference = np.abs(numbers - drawn).max()
            if difference < best:
                legs = " ".join(str(leg + 1) for leg in order)
                best, words = (
                    float(difference),
                    f"{what} 1 to {mechanism.joint_count} of the drawing are {legs} there",
                )
    return words


def _parts(mechanism: Mechanism) -> Iterator[tuple[str, tuple[str, ...]]]:
    """What may be in another order, and the symbols of its parameters."""
    legs = each_of(mechanism.joint_count)
    kinds = [kind for kind in mechanism.parameters.kinds if kind.owners == legs]
    yield "legs", tuple(kind.symbol for kind in kinds)
    for part in (MachinePart.PLATFORM, MachinePart.BASE):
        of_part = (kind for kind in kinds if kind.part is part and kind.unit is ParameterUnit.MM)
        yield f"the joints on the {part}", tuple(kind.symbol for kind in of_part)


def reordered(geometry: Geometry, symbols: tuple[str, ...], order: tuple[int, ...]) -> Geometry:
    """A geometry whose legs have these kinds of parameters in another order."""
    shapes, rows = geometry.parameters.shapes, list(order)
    values = {name: geometry[name][rows] if name in symbols else geometry[name] for name in shapes}
    return Geometry.of(geometry.parameters, values)
