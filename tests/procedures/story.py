"""Events and identifications as they would happen, short to write."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.identification.solver.result import Termination
from hexacell.results.result import IdentificationResult
from procedures.run.keys import SetKey, SixNumbers, ThreeNumbers
from procedures.run.readings import Reading
from procedures.run.state import RunState
from procedures.steps import events
from procedures.workflow import next_step as workflow

NOTHING_IS_ZERO = (0.0, 0.0, 0.0)
READING = Reading(
    gauges_mm=NOTHING_IS_ZERO,
    spread_mm=NOTHING_IS_ZERO,
    joints=(0.0,) * 6,
    answers=(),
    counts=(),
    skews_s=(),
)


def next_step(calibration: Any, state: RunState) -> Any:
    """The next step, of whatever kind."""
    return workflow.next_step(calibration, state)


def located(pose: SixNumbers) -> events.Located:
    return events.Located(pose=pose, joints=(0.0,) * 6, encoders=(0.0,) * 6)


@dataclass(frozen=True)
class Story:
    """Events as they would happen, short to write."""

    key: SetKey

    def arrived(self, orientation: int = 1, pose: SixNumbers | None = None) -> events.Event:
        pose = pose or (100.0, -100.0, 500.0, float(orientation - 1), 0.0, 0.0)
        return events.Arrived(at=self.key, orientation=orientation, pose=pose)

    def placed(self) -> events.Event:
        return events.GaugesPlaced(at=self.key)

    def sampled(
        self,
        orientation: int = 1,
        deviation: ThreeNumbers = NOTHING_IS_ZERO,
        pose: SixNumbers | None = None,
    ) -> events.Event:
        reading = READING.model_copy(update={"gauges_mm": deviation})
        where = self.arrived(orientation, pose).model_dump(include={"at", "orientation", "pose"})
        return events.RecordTaken(**where, reading=reading, deviation_mm=deviation)

    def refused(self, orientation: int = 2, *, on_the_way: bool = False) -> events.Event:
        reason = "the ball left the travel"
        return events.RecordRejected(
            at=self.key, orientation=orientation, reason=reason, on_the_way=on_the_way
        )

    def excluded(self, orientation: int = 2, pose: SixNumbers | None = None) -> events.Event:
        where = self.arrived(orientation, pose).model_dump(include={"at", "orientation", "pose"})
        return events.PoseExcluded(**where, reason="would exceed joint 3's positive limit")

    def closed(self) -> events.Event:
        return events.SetClosed(at=self.key, drift_mm=NOTHING_IS_ZERO, reading=READING)

    def undone(self, orientation: int) -> events.Event:
        return events.RecordDiscarded(at=self.key, orientation=orientation)

    def confirmed(self) -> events.Event:
        return events.ReferenceConfirmed(at=self.key, change_mm=NOTHING_IS_ZERO, reading=READING)

    def voided(self) -> events.Event:
        return events.SetInvalidated(at=self.key, reason="interrupted")

    def whole(self, orientations: int) -> list[events.Event]:
        """A set measured from its first move to its closing."""
        told = [self.arrived(), self.placed(), self.sampled()]
        for orientation in range(2, orientations + 1):
            told += [self.arrived(orientation), self.sampled(orientation)]
        return [*told, self.arrived(), self.closed()]


def an_identification(**changes: Any) -> IdentificationResult:
    """The drawing of the simulated cell, found without doubt; fields may be changed."""
    nominal = load_cell(bundled_config("simulated-hexaglide")).settings.robot.nominal.model_dump()
    document = {
        "converged": True,
        "termination": next(end for end in Termination if end.converged),
        "iterations": 3,
        "records": 18,
        "points": 2,
        "residual_rms_mm": 0.001,
        "chi2": 12.0,
        "dof": 11,
        "geometry": nominal,
        "sigma": nominal,
        "covariance": np.eye(42).tolist(),
        "undetermined": (),
        "outliers": (),
        "frame": "as drawn",
    }
    return IdentificationResult.model_validate(document | changes)
