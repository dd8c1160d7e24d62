"""The measurement file of a run belongs to what commanded it, whatever the controller has by now."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.config.interface import ControllerLimits
from hexacell.config.toml_format import native_layout
from hexacell.errors import IdentifiabilityError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import FrameTransform
from hexacell.measurements.records import MeasurementSet
from hexacell.noise.measured_noise import InstrumentNoise, MeasuredNoise
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.recorded_cell import commanding_geometries, recorded_state
from hexacell.services.offline import fit_measurements
from hexacell.text.identification import identification_report
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.story import READING
from tests.recorded_events import record

ON_FLOOR = FrameTransform(
    base=Rotation.from_rotvec([-0.7, 0.0, 0.0]).as_matrix(),
    origin=np.array([50.0, 200.0, -900.0]),
    platform=Rotation.from_rotvec([0.3, 0.1, -0.5]).as_matrix(),
)
"""From the paper's frames to those of a config with its origin on the floor."""
TURNED = FrameTransform(np.eye(3), np.array([5.0, -8.0, 12.0]), ON_FLOOR.platform.T)
"""What a calibration changes of them, and more."""


@pytest.fixture
def cell(tmp_path: Path, paper) -> Cell:
    """A cell that was calibrated: its controller has the true geometry in frames of its own."""
    source = load_cell(bundled_config("simulated-hexaglide"))
    shutil.copy(source.path, tmp_path)
    text = source.config_path.read_text()
    now = Hexaglide().change_frames(paper.actual, ON_FLOOR.then(TURNED))
    (tmp_path / source.config_path.name).write_text(
        native_layout(HEXAGLIDE_PARAMETERS).rewrite([text], now)[0]
    )
    return load_cell(tmp_path / source.path.name)


def run_of(folder: Path, *history: events.Event) -> RunFolder:
    record(RunFolder(folder).journal, history)
    return RunFolder(folder)


def started(controller: Geometry, paper) -> events.RunStarted:
    return events.RunStarted(
        software="hexacell",
        cell="a cell",
        cell_text="",
        mode="optimise",
        config="a config",
        config_sha256="",
        controller=controller.document(),
        branch=paper.branch,
        devices=(),
        taught=controller.document(),
        joint_ranges=((-800.0, 800.0),) * 6,
        limits=ControllerLimits(),
    )


def test_they_are_those_of_the_journal_in_the_frames_of_the_run(tmp_path, paper):
    controller = Hexaglide().change_frames(paper.nominal, ON_FLOOR)
    lent = events.ProvisionalApplied(geometry=paper.calibrated.document(), folder="lent")
    settings = load_cell(bundled_config("simulated-hexaglide")).settings
    run = recorded_state(run_of(tmp_path, started(controller, paper), lent), settings)
    own, provisional = commanding_geometries(run, settings.mechanism)
    np.testing.assert_allclose(own.geometry.vector, paper.nominal.vector, atol=1e-9)
    np.testing.assert_array_equal(provisional.geometry.vector, paper.calibrated.vector)
    for one in (own, provisional):
        np.testing.assert_allclose(one.frames.origin, ON_FLOOR.inverse().origin, atol=1e-9)


def measured_noise(*gauges_mm: float) -> events.NoiseMeasured:
    gauges = [InstrumentNoise(name="a gauge", stated=0.01, record=one) for one in gauges_mm]
    encoder = InstrumentNoise(name="an encoder", stated=0.01, record=0.01)
    noise = MeasuredNoise(gauges=tuple(gauges), encoders=(encoder,) * 6)
    return events.NoiseMeasured(at=SetKey(phase=Phase.IDENTIFY, point=1), noise=noise)


def test_records_in_a_run_folder_are_weighted_by_the_noise_that_the_run_measured(tmp_path, paper, visit):
    cell, measured = load_cell(bundled_config("simulated-hexaglide")), visit(seed=2).measured(0.01, seed=1)
    noise, reading = measured_noise(0.01, 0.04, 0.01), READING.model_copy(update={"counts": ((0,) * 6,)})
    closed = events.SetClosed(at=noise.at, drift_mm=(0.0,) * 3, reading=reading, walk_mm=0.002, walk_s=20.0)
    run = run_of(tmp_path, started(paper.nominal, paper), noise, closed)
    assessed = fit_measurements(cell, measured, run)
    assert assessed.measured_noise == noise.noise
    assert "noise                    gauges 10 to 40, encoders 10 um" in identification_report(assessed)
    assert assessed.found.problem.noise.gauges_mm == pytest.approx([0.01, 0.04, 0.01])
    assert assessed.found.problem.noise.walk.step_mm == 0.002, "the drift that it found"
    alone = fit_measurements(cell, measured)
    assert alone.measured_noise is None
    assert "noise                    gauges" not in identification_report(alone)
    assert alone.found.problem.noise.gauges_mm == pytest.approx([0.01, 0.01, 0.01])
    assert assessed.found.goodness.ratio < alone.found.goodness.ratio
    nothing = recorded_state(RunFolder(tmp_path / "nothing"), cell.settings)
    assert nothing.noise is None
    assert commanding_geometries(nothing, cell.settings.mechanism) == ()


def test_records_in_a_run_folder_are_fitted_after_the_controller_got_other_frames(
    cell, tmp_path, paper, visit
):
    exact = visit(seed=2).measured()
    told = MeasurementSet(
        tuple(
            replace(
                record,
                pose=ON_FLOOR.poses(exact.poses).pose(row),
                deviation=tuple((ON_FLOOR.base @ record.deviation).tolist()),
            )
            for row, record in enumerate(exact.records)
        )
    )
    with pytest.raises(IdentifiabilityError, match="do not belong to the commanded pose"):
        fit_measurements(cell, told)
    (tmp_path / "run").mkdir()
    controller = Hexaglide().change_frames(paper.nominal, ON_FLOOR)
    assessed = fit_measurements(cell, told, run_of(tmp_path / "run", started(controller, paper)))
    assert assessed.found.termination.converged
    assert assessed.found.geometry.largest_difference(paper.actual) < 0.5
