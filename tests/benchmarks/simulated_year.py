"""A year of a cell that is checked each night: what the program keeps of it, in its real files.

A robot drifts slowly and crashes once; a gauge is dead for a week, the disk is full one night, the power
fails in another. Usual nights run the real procedure on devices without wires. Nights with a fault run the
whole program, with drivers and simulated devices. All have a clock of their own. A night after a check that
failed is a quick level.
"""

import asyncio
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.cell.simulation import SimulatedFault
from hexacell.cli.app import main
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import robot_of
from hexacell.runs import run_folder
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.history.drift_history import drift_history
from hexacell.services.history.past_runs import past_runs
from hexacell.services.run.calibration_run import new_calibration
from hexacell.services.unattended import unattended_runs
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.journal import journal as line_format
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from tests.procedures.rig import Rig
from tests.small_cell import FEW_CHOICES, SMALL, changed, few_candidates, write_small_cell

FIRST_NIGHT = datetime(2026, 3, 1, 2, 30, tzinfo=UTC)
LIMIT_MM, LIMIT_DEG = 0.25, 0.1
SERVED: dict[str, Any] = {
    "timing.clock_factor": 500.0,
    "encoders.timeout_s": 10.0,
    "encoders.heartbeat_ms": 10_000,
    "simulation.motion.ringing_mm": 0.05,
    **dict.fromkeys(("speed.joint", "speed.joint_at_gauges"), 1000.0),
    **dict.fromkeys(("speed.edge_mm_s", "speed.edge_at_gauges_mm_s"), 1000.0),
}
"""Real drivers are patient with simulated devices on a fast clock."""

AS_BUNDLED = ("identification", "verification", "noise.encoder", "noise.gauge", "simulation")

DEAD_GAUGE = {"simulation.faults": (SimulatedFault(kind="silent", device="y"),)}
FULL_DISK = {"guards.free_disk_mb": 1e12}


@dataclass
class Night:
    """What is known of a night that no archive knows: the truth, and what the program said."""

    number: int
    mode: Mode
    error_before_mm: float
    error_after_mm: float
    exit_code: int | None = None
    verdict: Verdict | None = None
    is_written: bool = False


@dataclass
class Year:
    """The nights of one cell.

    Attributes:
        drift_mm: of the length of leg 2, a night.
        crash_night: in the day before which leg 4 becomes ``crash_mm`` longer.
        faults: of nights, as changes of the cell file.
    """

    folder: Path
    drift_mm: float
    crash_night: int
    crash_mm: float
    faults: dict[int, dict[str, Any]]
    power_cuts: frozenset[int] = frozenset()
    nights: list[Night] = field(default_factory=list)

    @cached_property
    def cell(self) -> Cell:
        limits = {"acceptance.position_mm": LIMIT_MM, "acceptance.orientation_deg": LIMIT_DEG}
        small = {key: value for key, value in SMALL.items() if not key.startswith(AS_BUNDLED)}
        return write_small_cell(self.folder, small | SERVED | limits, timeout_s=6.0)

    def carry_out(self, nights: int) -> None:
        """A calibration, and so many nights less one after it."""
        with few_candidates():
            self._usual_night(0, Mode.OPTIMISE)
            for number in range(1, nights):
                mode = Mode.QUICK if self._has_failed() else Mode.CHECK
                if number in self.faults or number in self.power_cuts:
                    self._night_of_the_program(number, mode)
                else:
                    self._usual_night(number, mode)

    def truth(self, number: int) -> Geometry:
        """The robot in a night, in the mechanism's frame convention."""
        simulation = self.cell.settings.simulation
        assert simulation is not None
        parameters = self.cell.settings.mechanism.parameters
        vector = Geometry.of(parameters, simulation.geometry.model_dump()).vector.copy()
        vector[parameters.names.index("l2")] += self.drift_mm * number
        vector[parameters.names.index("l4")] += self.crash_mm * (number >= self.crash_night)
        return self.cell.settings.mechanism.normalize_frames(Geometry(parameters, vector))[0]

    def at(self, number: int) -> datetime:
        """When a night begins."""
        return FIRST_NIGHT + timedelta(days=number)

    def true_error_mm(self, number: int) -> float:
        """The largest position error at the task poses with the current config, best frames taken off."""
        robot = robot_of(self.cell)
        calibration = Calibration(self.cell.settings, robot, Mode.OPTIMISE, effort=FEW_CHOICES)
        jacobian = calibration.plan.task.jacobian(robot.belief())
        assert jacobian is not None
        free = robot.mechanism.convention.free_parameters(self.truth(number))
        return float(np.linalg.norm((jacobian @ (free - robot.free_parameters))[:, :3], axis=-1).max())

    def explanations(self) -> dict[int, list[str]]:
        """What the history says of each night: a verdict, or why there is none."""
        told: dict[int, list[str]] = {night.number: [] for night in self.nights}
        for run in past_runs(self.cell):
            assert run.summary.began is not None, run.summary.line
            number = (run.summary.began.date() - FIRST_NIGHT.date()).days
            told[number].append(run.summary.line)
        return told

    def archive_is_consistent(self) -> bool:
        """Whether the index gives what the run folders alone give, of runs and of their evidence."""
        kept = past_runs(self.cell), drift_history(self.cell)
        for path in runs_folder(self.cell).glob("index.sqlite*"):
            path.unlink()
        return kept == (past_runs(self.cell), drift_history(self.cell))

    def _has_failed(self) -> bool:
        return next(
            (one.verdict is Verdict.FAIL for one in reversed(self.nights) if one.verdict is not None), False
        )

    def _usual_night(self, number: int, mode: Mode) -> None:
        before, folder = self.true_error_mm(number), RunFolder(self._place(number))
        with clock_at(self.at(number)):
            tonight = load_cell(self._tonight(number))
            folder.create(tonight)
            rig = Rig(tonight, folder, mode, accepted=new_calibration(self.cell, mode).accepted)
            asyncio.run(rig.run())
        state, after = fold(read_journal(folder.journal)), self.true_error_mm(number)
        assert state.judged is not None
        is_written = state.committed is not None and not state.rolled_back
        self.nights.append(
            Night(number, mode, before, after, verdict=state.judged.verdict, is_written=is_written)
        )

    def _place(self, number: int) -> Path:
        return runs_folder(self.cell) / self.at(number).strftime("%Y-%m-%dT%H%M%SZ")

    def _night_of_the_program(self, number: int, mode: Mode) -> None:
        """Everything, with simulated devices; after a power cut half of the night's journal is left."""
        before, words = self.true_error_mm(number), StringIO()
        tonight = str(self._tonight(number))
        with clock_at(self.at(number)), redirect_stdout(words), redirect_stderr(words):
            code = main(["run", tonight, "--unattended", "--mode", mode.value])
        if number in self.power_cuts:
            assert self._place(number).joinpath("journal.jsonl").is_file(), words.getvalue()
            cut_off(RunFolder(self._place(number)))
            for later in runs_folder(self.cell).glob(f"{self.at(number):%Y-%m-%d}T*"):
                if later != self._place(number):
                    shutil.rmtree(later)  # what would have been done after it
        self.nights.append(Night(number, mode, before, self.true_error_mm(number), code))

    def _tonight(self, number: int) -> Path:
        """The cell file with the robot, the noise and the faults of a night."""
        simulation = self.cell.settings.simulation
        assert simulation is not None
        values = self.cell.settings.mechanism.parameters.document(self.truth(number).vector)
        geometry = type(simulation.geometry).model_validate(values)
        own = {"simulation.geometry": geometry, "simulation.seed": number} | self.faults.get(number, {})
        path = self.folder / "tonight.toml"
        path.write_text(dump(changed(self.cell.settings, own)))
        return path


def cut_off(folder: RunFolder) -> None:
    """What a power cut leaves: the journal up to some record, and part of the next line."""
    lines = folder.journal.read_bytes().splitlines(keepends=True)
    records = [n for n, line in enumerate(lines) if b'"kind":"sampled"' in line]
    middle = records[len(records) // 2]
    folder.journal.write_bytes(b"".join(lines[:middle]) + lines[middle][:40])
    for path in folder.path.iterdir():
        if path.name not in {folder.journal.name, "cell.toml"}:
            path.unlink() if path.is_file() else shutil.rmtree(path)


@contextmanager
def clock_at(begin: datetime) -> Iterator[None]:
    """The computer's clock as the program's folders, journals and notes have it."""
    real = datetime.now(UTC)

    class Clock:
        fromisoformat = datetime.fromisoformat

        @staticmethod
        def now(tz: Any = None) -> datetime:
            return (begin + (datetime.now(UTC) - real)).astimezone(tz)

    with pytest.MonkeyPatch.context() as patch:
        for module in (line_format, run_folder, unattended_runs):
            patch.setattr(module, "datetime", Clock)
        yield
