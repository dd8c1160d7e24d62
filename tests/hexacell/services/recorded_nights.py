"""Runs of a cell on the disk, a night apart: a calibration and checks of a robot that may change."""

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Any

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.checks.check_result import CheckResult
from hexacell.identification.estimator import identify
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.results.result import AcceptedResult, IdentificationResult
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.calibration_run import run_started
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.journal.journal import Entry, encode
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading, Temperature, on_parts
from procedures.steps import events

FIRST_NIGHT = datetime(2026, 3, 1, 2, 30, tzinfo=UTC)
TILTS = [(0, 0, 0), (20, 5, 0), (-15, 15, 10), (5, -20, -10), (-20, -5, 15), (12, 18, -20)]
MORE_TILTS = [(-10, 8, 20), (18, -12, 5), (8, 20, -15), (-18, -14, -8), (25, 0, 12)]


@dataclass
class Nights:
    """The nights of a cell whose robot has the geometry of its controller's config until it changes."""

    cell: Cell
    seed: int = 0
    number: int = 0
    changes: dict[str, float] = field(default_factory=dict)
    celsius: dict[str, float | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)

    @cached_property
    def robot(self) -> Robot:
        return robot_of(self.cell)

    @property
    def truth(self) -> Geometry:
        parameters = self.robot.mechanism.parameters
        vector = self.robot.commanding.vector.copy()
        for name, change in self.changes.items():
            vector[parameters.names.index(name)] += change
        return self.robot.mechanism.normalize_frames(Geometry(parameters, vector))[0]

    def calibrate(self) -> RunFolder:
        """A calibration at all points."""
        records = self.measured(len(self.cell.settings.identification.points), TILTS + MORE_TILTS)
        found = identify(self.robot.problem(MeasurementSet(records)))
        return self._keep(
            records, "optimise", events.Identified(result=IdentificationResult.of(found), held_out=())
        )

    def check(self, *, spoilt: bool = False, **result: Any) -> RunFolder:
        """A check at two points; ``spoilt``: one record of it is wrong by a millimetre."""
        records = self.measured(2, TILTS)
        if spoilt:
            wrong = records[4]
            records = (*records[:4], replace(wrong, deviation=(1.0, *wrong.deviation[1:])), *records[5:])
        found = CheckResult(verdict=Verdict.PASS, records=len(records), points=2, earlier_run="x", **result)
        judged = events.ResultValidated(verdict=Verdict.PASS, line="", check=found)
        accepted = AcceptedResult(
            run="x", at=FIRST_NIGHT, covariance=tuple(map(tuple, np.eye(42).tolist()))
        )
        return self._keep(records, "check", judged, accepted=accepted)

    def measured(self, points: int, tilts: list[tuple[int, int, int]]) -> tuple[Record, ...]:
        """Records of the robot as it is now."""
        virtual, records = VirtualRobot(self.robot, self.truth, self.random), []
        for point, place in enumerate(self.cell.settings.identification.points[:points], start=1):
            virtual.zero_gauges()
            for orientation, tilt in enumerate(tilts, start=1):
                virtual.place(Pose(*place, *map(float, tilt)))
                records.append(virtual.measure(point, orientation))
        return tuple(records)

    def _keep(
        self,
        records: tuple[Record, ...],
        mode: str,
        result: events.Event,
        accepted: AcceptedResult | None = None,
    ) -> RunFolder:
        calibration = Calibration(self.cell.settings, self.robot, Mode(mode), accepted=accepted)
        started = run_started(self.cell, calibration, ())
        history = [started, *map(self.taken, records), result, events.Ended(exit_code=0, line="over")]
        at = FIRST_NIGHT + timedelta(days=self.number)
        self.number += 1
        folder = RunFolder(runs_folder(self.cell) / at.strftime("%Y-%m-%dT%H%M%SZ"))
        folder.path.mkdir(parents=True)
        lines = [encode(Entry(n, at, 0.0, event)) for n, event in enumerate(history, start=1)]
        folder.journal.write_bytes(b"".join(lines))
        return folder

    def taken(self, record: Record) -> events.RecordTaken:
        pose = record.pose.as_tuple()
        temperatures = tuple(Temperature(name=n, celsius=c) for n, c in self.celsius.items())
        reading = Reading(
            gauges_mm=record.deviation,
            spread_mm=(0.0, 0.0, 0.0),
            joints=record.joints,
            answers=(),
            counts=((0,) * 6,),
            skews_s=(),
            temperatures=temperatures,
            part_temperatures=on_parts(self.cell.settings.thermometers, temperatures),
        )
        return events.RecordTaken(
            at=SetKey(phase=Phase.IDENTIFY, point=record.point),
            orientation=record.orientation,
            pose=pose,
            reading=reading,
            deviation_mm=record.deviation,
        )
