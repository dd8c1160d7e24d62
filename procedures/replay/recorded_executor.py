"""The step executor of a replay: devices and operator answer from the journal.

No robot moves, so there is nothing to supervise: the guards of a replay only evaluate numbers.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self, TypeVar, cast

import numpy as np

from drivers.errors import GaugeAtEnd
from hexacell.cell.loader import Cell
from hexacell.clock import CellClock
from hexacell.errors import AnswerNeeded, DeviceError
from hexacell.kinematics.pose import Pose
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.calibration import Calibration
from procedures.devices.device_set import Devices
from procedures.guards.guards import Guards
from procedures.guards.position_check import PositionReports
from procedures.guards.supervision import Supervised
from procedures.run.questions import Question
from procedures.run.readings import Reading, ReadingSeries
from procedures.run.state import RunState
from procedures.steps import events
from procedures.workflow.next_step import StepExecutor

TOLERANCE = 1e-9
"""Largest difference that counts as rounding: absolute in the field's unit, above 1 relative."""

Result = TypeVar("Result")


@dataclass(slots=True)
class Recorded:
    """The recorded outcome of the step that is repeated, and the operator who gives its answers."""

    outcome: events.Event | None = None

    async def ask(self, question: Question) -> str | None:
        """Who approved a change or kept it, if a person did; a failure is never asked about here."""
        match self.outcome:
            case events.Committed(approved_by=name):
                return name
            case events.ResultAccepted(asked=False):
                raise AnswerNeeded("nobody was asked")
            case events.ResultAccepted(by=name):
                return name
        return question.default


class _Absent:
    """Encoders and controller of a replay: the executor has their readings, and no order does anything."""

    def __getattr__(self, _name: str) -> Callable[..., Awaitable[None]]:
        return _nothing


async def _nothing(*_args: object, **_named: object) -> Any:  # noqa: ANN401 - of whatever is asked
    """Nothing to do."""


class InactiveGuards(Guards):
    """Guards without supervision."""

    prepare = move = while_not_ready = locate = _nothing

    async def at_standstill(self, action: Supervised[Result]) -> Result:
        """Run it."""
        return await action()


@dataclass(frozen=True, eq=False)
class RecordedStepExecutor(StepExecutor):
    """A step executor with the recorded outcome of each step in place of devices."""

    recorded: Recorded = field(default_factory=Recorded)

    @classmethod
    def of(cls, cell: Cell, calibration: Calibration, folder: RunFolder) -> Self:
        """For a cell and a temporary folder."""
        recorded, absent = Recorded(), cast("Any", _Absent())
        devices = Devices((), absent, absent)
        return cls(cell, calibration, devices, CellClock(), recorded, folder, recorded=recorded)

    @cached_property
    def guards(self) -> Guards:
        """No supervision."""
        folder, config = self.folder.path, self.current_config
        return InactiveGuards(self.cell.settings, self.devices, self.clock, folder, config)

    require_unedited_config = require_departure = _nothing  # no robot moves

    async def locate(self) -> PositionReports:
        """The recorded position, which was checked then."""
        outcome = self.recorded.outcome
        if not isinstance(outcome, events.Located):
            raise DeviceError("the journal has no position for this step", subject="controller")
        joints = None if outcome.joints is None else np.array(outcome.joints)
        return PositionReports(Pose(*outcome.pose), joints, np.array(outcome.encoders))

    async def read_series(self, count: int) -> ReadingSeries:
        """The recorded series."""
        del count
        outcome = self.recorded.outcome
        if not isinstance(outcome, events.StandstillRead):
            raise DeviceError("the journal has no series", subject="the recorded devices")
        return ReadingSeries(**{name: getattr(outcome, name) for name in ReadingSeries.model_fields})

    async def read(self, state: RunState, windows: int = 1) -> Reading:
        """The recorded reading; raises ``GaugeAtEnd`` where the recorded gauges did."""
        outcome = self.recorded.outcome
        if isinstance(outcome, events.RecordRejected) and outcome.reading is None:
            raise GaugeAtEnd(outcome.reason)
        reading: Reading | None = getattr(outcome, "reading", None)
        if reading is None:
            raise DeviceError("the journal has no reading for this step", subject="the recorded devices")
        timing = self.cell.settings.timing
        too_wide = max(reading.spread_mm) > timing.spread_gauge_mm + TOLERANCE
        if too_wide or len(reading.counts) < windows * timing.readings:
            raise DeviceError("the recorded readings had not settled", subject="the recorded devices")
        return reading.model_copy(update={"directions": state.directions})
