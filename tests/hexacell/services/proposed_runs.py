"""Runs that proposed a change of a config, as files, without a run."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.config.change import ConfigChange, propose
from hexacell.config.layout import ConfigLayout, fingerprint
from hexacell.config.write_back import commit
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import robot_of
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.calibration_run import run_started
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import Verification
from procedures.calibration.calibration import Calibration, Mode
from procedures.steps import events
from tests.recorded_events import record
from tests.small_cell import FEW_CHOICES

MET = AcceptanceGate(name="converged", passed=True, sentence="It converged.")
GRAVE = AcceptanceGate(
    name="within tolerance", passed=False, sentence="Beyond: S1x.", needs_person=True, needs_cell_name=True
)


def a_cell(folder: Path) -> Cell:
    """A cell in a folder of its own, with comments in its config."""
    source = load_cell(bundled_config("simulated-hexaglide"))
    for path in (source.path, source.config_path):
        shutil.copy(path, folder)
    return load_cell(folder / source.path.name)


@dataclass(frozen=True)
class ProposedRun:
    """A run on the disk, and the texts of its proposal."""

    folder: RunFolder
    change: ConfigChange

    @property
    def before(self) -> bytes:
        return self.change.text_before.encode()

    @property
    def after(self) -> bytes:
        return self.change.text_after.encode()


def propose_run(
    cell: Cell,
    name: str = "2026-11-20T100000Z",
    *,
    shift_mm: float = 0.25,
    gates: tuple[AcceptanceGate, ...] = (MET,),
    verdict: Verdict | None = Verdict.PASS,
    corrections: Corrections | None = None,
    **verification: Any,
) -> ProposedRun:
    """A run that proposes every number of the config of now, shifted, and corrections."""
    folder = RunFolder(runs_folder(cell) / name)
    folder.create(cell)
    layout = ConfigLayout.of(cell.settings)
    found = layout.read(*cell.config_paths).geometry
    after = Geometry(found.parameters, found.vector + shift_mm)
    start = fingerprint(*cell.config_paths)
    change = propose(cell.config_paths, layout, after, corrections, fingerprint_at_start=start)
    change.save(folder.proposal)
    record(folder.journal, _history(cell, change, gates, verdict, verification))
    return ProposedRun(folder, change)


def _history(
    cell: Cell,
    change: ConfigChange,
    gates: tuple[AcceptanceGate, ...],
    verdict: Verdict | None,
    verification: dict[str, Any],
) -> list[events.Event]:
    calibration = Calibration(cell.settings, robot_of(cell), Mode.OPTIMISE, effort=FEW_CHOICES)
    history: list[events.Event] = [
        run_started(cell, calibration, ()).model_copy(update={"software": "hexacell 0"}),
        events.Proposed(gates=gates, written=change.after, corrections=change.corrections_after),
    ]
    if verdict is not None:
        judged = Verification(verdict=verdict, **({"before_mm": 1.0, "after_mm": 0.1} | verification))
        line = f"0.1 mm: {verdict.value}"
        history += [
            events.ResultValidated(verdict=verdict, line=line, verification=judged),
            events.RolledBack(),
        ]
    return [*history, events.Ended(exit_code=0, line="over")]


def committed_runs(cell: Cell, *names: str) -> list[ProposedRun]:
    """Calibrations, one after the other."""
    written = []
    for name in names:
        run = propose_run(cell, name)
        commit(run.change, run.folder.path)
        written.append(run)
    return written
