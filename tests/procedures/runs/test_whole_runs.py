"""Whole runs on fake devices, and the files of their run folders."""

import json
import re
import tomllib

import numpy as np

from hexacell.config.change import ConfigChange, Receipt
from hexacell.config.toml_format import native_layout
from hexacell.errors import ExitCode
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.measurements.csv_file import read_measurements
from procedures.calibration.calibration import Mode
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from tests.geometries import hexaglide_geometry
from tests.procedures.runs.listening import happened


def test_a_whole_run_passes(recording) -> None:
    ended = recording.history[-1]
    assert ended.exit_code == ExitCode.DONE
    assert ended.line.startswith("35 parameters, 18 records at 2 points; mean deviation at held-out poses")
    assert ended.line.endswith("(limit 5): pass")
    assert recording.controller_log[0] == "prepare"
    assert recording.controller_log.count("reload") == 1


def test_the_written_geometry_is_the_true_one_in_frames_near_those_of_before(recording, tmp_path) -> None:
    config = tmp_path / "after.toml"
    config.write_bytes(recording.config_after)
    written = native_layout(HEXAGLIDE_PARAMETERS).read(config).geometry
    truth = hexaglide_geometry(**tomllib.loads(recording.history[0].cell_text)["simulation"]["geometry"])
    found, expected = (Hexaglide().normalize_frames(geometry)[0].vector for geometry in (written, truth))
    (identified,) = (event for event in recording.history if isinstance(event, events.Identified))
    sigma = np.sqrt(np.diag(identified.result.estimate(HEXAGLIDE_PARAMETERS).covariance))
    assert np.abs(found - expected)[sigma > 0.0].max() > 0.0
    assert (np.abs(found - expected) <= 5.0 * sigma + 1e-6).all()
    # The journal has it, and says how far it moves what was taught.
    state = fold(recording.history)
    assert state.started is not None
    assert state.started.taught == state.started.controller
    assert state.proposed is not None
    assert state.proposed.written is not None
    noted = hexaglide_geometry(**state.proposed.written)
    assert written.largest_difference(noted) <= 1e-6
    assert Hexaglide().normalize_frames(written)[0].largest_difference(written) > 1.0
    displacement = state.proposed.displacement
    assert displacement is not None
    assert displacement.poses == 6
    assert displacement.position_mm > 1.0
    assert recording.history[-1].displacement == displacement


def test_the_run_folder_contains_measurements_result_proposal_and_backup(recording) -> None:
    folder = recording.folder
    measured = read_measurements(folder.measurements)
    state = fold(recording.history)
    assert measured == state.measurements()
    assert len(measured) == 18
    assert state.identified
    result = json.loads(folder.result.read_text())
    identified = state.identified.result.model_dump(mode="json")
    assert {key: result[key] for key in identified} == identified
    assert result["findings"]
    proposal = ConfigChange.load(folder.proposal)
    assert proposal.text_before.encode() == recording.config_before
    assert proposal.text_after.encode() == recording.config_after
    assert Receipt.of(folder.path).backup() == (recording.config_before,)


def test_a_run_reduces_the_held_out_deviations(recording) -> None:
    state = fold(recording.history)
    before, after = (np.linalg.norm(state.held_out(phase), axis=1) for phase in (Phase.BEFORE, Phase.AFTER))
    assert before.min() > 1.0
    assert after.max() < 0.1


async def test_a_check_measures_judges_and_changes_nothing(make_rig) -> None:
    rig = make_rig(Mode.CHECK)
    before = rig.config
    ended = await rig.run()
    assert ended.exit_code in {ExitCode.DONE, ExitCode.OUT_OF_LIMITS}
    assert re.match(r"check: \d+ records at 2 points; position error at the task poses \d", ended.line)
    assert rig.config == before
    assert "reload" not in rig.controller.log
    phases = {event.at.phase for event in happened(rig, events.RecordTaken)}
    assert phases == {Phase.IDENTIFY}
    computed = [event.step.kind for event in happened(rig, events.StepBegun) if event.step.moves_nothing]
    assert computed == ["judge"]


async def test_a_check_whose_budget_is_used_says_how_many_records_would_decide(make_rig) -> None:
    rig = make_rig(Mode.CHECK, check__budget_records=4, acceptance__position_mm=30.0)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert re.search(r": not evaluated \(about \d+ more records would decide\)$", ended.line)
    assert len(happened(rig, events.RecordTaken)) == 4


def test_records_know_from_which_side_joints_arrived(recording) -> None:
    """As they moved at the end of the controller's straight line, to where the robot then stands."""
    mechanism, checked = Hexaglide(), 0
    geometry = hexaglide_geometry(**recording.history[0].controller)
    branch, here, arrived = recording.history[0].branch, None, None
    for event in recording.history:
        if isinstance(event, events.Committed):
            break
        if isinstance(event, events.Located):
            here, arrived = event.pose, None
        if isinstance(event, events.Arrived):
            numbers = np.array([here, event.pose])
            near_end = [Pose(*(0.005 * numbers[0] + 0.995 * numbers[1])), Pose(*numbers[1])]
            last = np.diff(mechanism.inverse(geometry, branch, PoseBatch.of(near_end)), axis=0)[0]
            known = np.array(event.directions) != 0
            moved = known & (np.abs(last) > 1e-3)
            np.testing.assert_array_equal(np.array(event.directions)[moved], np.sign(last)[moved])
            checked += int(moved.sum())
            here, arrived = event.pose, event
        if isinstance(event, events.RecordTaken):
            assert arrived is not None
            assert (event.at, event.orientation, event.pose) == (
                arrived.at,
                arrived.orientation,
                arrived.pose,
            )
            assert event.record.directions == event.reading.directions == arrived.directions
    assert checked > 100
