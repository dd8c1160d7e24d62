"""The quick level from the cell file to its end: through real drivers and files."""

import asyncio
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.config.layout import fingerprint
from hexacell.errors import ExitCode
from hexacell.identification.estimator import identify
from hexacell.results.result import AcceptedResult
from hexacell.robot.model import robot_of
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.accepted_results import last_accepted_result
from hexacell.services.run.calibration_run import calibrate
from hexacell.services.run.replay_run import replay
from hexacell.verdict.decision import Verdict
from procedures.calibration.calibration import Calibration, Mode
from procedures.journal.journal import read_journal
from procedures.run.state import RunState, fold
from procedures.steps import events
from tests.hexacell.services.conftest import Finished, maker, order_of
from tests.small_cell import FEW_CHOICES, few_candidates

BUDGET = 20
DRIFT_MM = 0.1


def drifted_cell(folder: Path, finished: Finished) -> Cell:
    """The cell that was calibrated, of whose robot one leg has become longer since."""
    simulation = finished.cell.settings.simulation
    assert simulation is not None
    truth = simulation.geometry.model_dump()
    lengths = list(truth["l"])
    lengths[3] += DRIFT_MM
    geometry = simulation.geometry.model_copy(update={"l": tuple(lengths)})
    cell = maker(folder)(simulation__geometry=geometry, quick__budget_records=BUDGET)
    cell.config_path.write_bytes(finished.cell.config_path.read_bytes())
    shutil.copytree(runs_folder(finished.cell), runs_folder(cell))
    return cell


@dataclass(frozen=True)
class Corrected:
    """The same after a run of the quick level."""

    cell: Cell
    started_from: AcceptedResult | None
    ended: events.Ended
    state: RunState
    folder: RunFolder


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory, finished: Finished) -> Corrected:
    cell = drifted_cell(tmp_path_factory.mktemp("corrected"), finished)
    before = last_accepted_result(cell)
    with few_candidates():
        return Corrected(cell, before, *asyncio.run(a_quick_run(cell)))


async def a_quick_run(cell: Cell, name: str = "quick") -> tuple[events.Ended, RunState, RunFolder]:
    folder = RunFolder(runs_folder(cell) / name)
    ended = await calibrate(order_of(cell, folder, mode=Mode.QUICK))
    return ended, fold(read_journal(folder.journal)), folder


async def test_a_robot_that_drifted_is_corrected_by_few_records(corrected, finished) -> None:
    assert corrected.started_from is not None
    state, folder = corrected.state, corrected.folder
    assert corrected.ended.exit_code == ExitCode.DONE
    assert state.judged is not None
    assert state.judged.verdict is Verdict.PASS
    assert state.judged.verification is not None
    means = state.judged.verification.before_mm, state.judged.verification.after_mm
    assert means[0] is not None
    assert means[1] is not None
    assert means[0] > 2.0 * means[1]
    assert state.identified is not None
    assert state.identified.quick is not None
    assert state.identified.quick.records == len(state.measurements()) <= BUDGET
    # What it wrote is what the next run starts from, with a covariance of its own.
    after = last_accepted_result(corrected.cell)
    assert after is not None
    assert after.run == str(folder.path)
    assert fingerprint(corrected.cell.config_path) != fingerprint(finished.cell.config_path)
    assert (await replay(folder.path)).differences == []


def test_its_residuals_are_judged_by_what_was_known_before(corrected) -> None:
    """Where an earlier result holds some parameters, fewer are taken from the residuals than there are."""
    state = corrected.state
    assert state.identified is not None
    result = state.identified.result
    assert result.expected_chi2 is not None
    assert result.expected_chi2 >= result.dof
    assert result.residuals.is_explained
    assert result.undetermined == ()
    assert state.proposed is not None
    assert all(gate.passed for gate in state.proposed.gates)


def test_what_effects_did_to_the_result_before_counts(corrected) -> None:
    """An encoder that reads long did so in the calibration as well: its records do not average that."""
    cell, state = corrected.cell, corrected.state
    uncertain = cell.settings.uncertainty.model_copy(update={"encoder_scale_um_m": 100.0})
    settings = cell.settings.model_copy(update={"uncertainty": uncertain})
    assert state.started is not None
    before = state.started.accepted
    effects = last_accepted_result(replace(cell, settings=settings))
    assert before is not None
    assert effects is not None
    known = before.model_copy(update={"effects": effects.effects})
    calibration = Calibration(settings, robot_of(cell), Mode.QUICK, accepted=known, effort=FEW_CHOICES)
    robot = calibration.known(state).robot_of(state)
    assert robot.known_effects.keys() == {"scale of each encoder"}
    found = identify(robot.problem(state.measurements()))
    belief = robot.belief(found)
    task = Task.of(settings, robot, belief)
    whole, forgetful = (task.budget(found, belief, robot.effects, one) for one in (robot.known_effects, {}))
    assert whole is not None
    assert forgetful is not None
    # By the noise of the run it is more or less, so that at one pose it may happen to change nothing.
    remembered, forgotten = (
        np.linalg.norm(budget.systematic[:, :3], axis=(1, 2)) for budget in (whole, forgetful)
    )
    assert not np.allclose(remembered, forgotten, rtol=1e-3)
