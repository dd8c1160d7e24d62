"""The identified parameters as a table of fixed width: old, new, change, sigma, and what that means."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.checks.check_result import ParameterChange
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.services.recorded.started_robot import geometry_before
from procedures.run import events
from procedures.run.state import RunState

PARAMETER_COLUMNS = f"{'':6}{'old':>12}{'new':>12}{'change':>10}{'sigma':>9}  {'':24}"
SIGNIFICANT = 3.0
"""Standard deviations from which a change is called one."""


def parameter_lines(state: RunState, settings: CellSettings | None) -> tuple[str, ...]:
    """A line for each parameter; of a check its change since the geometry was identified.

    Both geometries are in the mechanism's frame convention, so that a choice of frames is no change.
    """
    if state.judged is not None and state.judged.check is not None:
        return tuple(map(_changed_row, state.judged.check.changes)) or ("No parameter was free.",)
    if state.identified is None or state.started is None or settings is None:
        return ("The geometry is not identified yet.",)
    return tuple(_rows(state.started, state.identified, settings))


def _rows(
    started: events.RunStarted, identified: events.Identified, settings: CellSettings
) -> Iterator[str]:
    mechanism, result = settings.mechanism, identified.result
    parameters, undetermined = mechanism.parameters, frozenset(result.undetermined)
    old = geometry_before(settings, started).vector
    new, sigma = parameters.vector(result.geometry), parameters.vector(result.sigma)
    for row in np.flatnonzero(sigma > 0.0):
        parameter, change = parameters.parameters[row], new[row] - old[row]
        decimals = 3 if parameter.kind.unit is ParameterUnit.MM else 6
        values = f"{old[row]:12.{decimals}f}{new[row]:12.{decimals}f}"
        sizes = f"{change:+10.{decimals}f}{sigma[row]:9.{decimals}f}"
        word = _word(change, sigma[row], is_known=parameter.name not in undetermined)
        yield f"{parameter.name:6}{values}{sizes}  {word}"


def _changed_row(found: ParameterChange) -> str:
    """A check compares with the controller's geometry, and has no new one."""
    sizes = f"{found.change:+10.3f}{found.sigma:9.3f}"
    return f"{found.name:6}{'':24}{sizes}  {_word(found.change, found.sigma, is_known=True)}"


def _word(change: float, sigma: float, *, is_known: bool) -> str:
    if not is_known:
        return "not determined"
    times = abs(change) / sigma
    if times < SIGNIFICANT:
        return f"unchanged ({times:.1f} sigma)"
    return f"changed ({times:.0f} sigma)"
