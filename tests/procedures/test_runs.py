"""Whole runs on devices that obey: how each ends, and what is left in the controller."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import numpy as np
import pytest

from drivers.gauges.errors import GaugeAtEnd, GaugeSilent
from hexacell.controller_config.native_toml import NativeToml
from hexacell.controller_config.proposal import Proposal
from hexacell.controller_config.write_back import Receipt
from hexacell.errors import (
    AnswerNeeded,
    DeviceError,
    ExitCode,
    FileError,
    HexacellError,
    LimitError,
    WriteBackUndone,
)
from hexacell.geometry import Geometry
from hexacell.measurement_file import read_measurements
from hexacell.mechanisms.hexaglide import Hexaglide
from hexacell.verification import Verdict
from procedures import events
from procedures.calibration import Mode
from procedures.journal import read_journal
from procedures.operators import Nobody
from procedures.state import RunState, fold
from procedures.steps import Compute, Phase, Sample


def on(kind: type[Any], action: Any, count: int = 1) -> Any:
    """A listener that does something at the ``count``-th event of a kind."""
    seen = [0]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, kind):
            seen[0] += 1
            if seen[0] == count:
                action()

    return listener


def before_sampling(key: str, action: Any) -> Any:
    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key:
            action()

    return listener


def happened(rig: Any, kind: type[Any]) -> list[Any]:
    return [event for event in read_journal(rig.folder.journal) if isinstance(event, kind)]


def test_a_whole_run_passes(recording) -> None:
    ended = recording.history[-1]
    assert ended.exit_code == ExitCode.DONE
    assert ended.line.startswith("35 parameters, 18 records at 2 points; mean deviation at held-out points")
    assert ended.line.endswith("(limit 0.2): pass")
    assert recording.controller_log[0] == "prepare"
    assert recording.controller_log.count("reload") == 1


def test_the_controller_gets_the_true_geometry(recording, tmp_path) -> None:
    config = tmp_path / "after.toml"
    config.write_bytes(recording.config_after)
    written = NativeToml().read(config).geometry
    truth = Geometry(**tomllib.loads(recording.history[0].cell_text)["simulation"]["geometry"])
    found, expected = (Hexaglide().to_convention(geometry)[0].vector() for geometry in (written, truth))
    (identified,) = (event for event in recording.history if isinstance(event, events.Identified))
    sigma = Geometry(**identified.result["sigma"]).vector()
    assert np.abs(found - expected)[sigma > 0.0].max() > 0.0
    assert (np.abs(found - expected) <= 5.0 * sigma + 1e-6).all()


def test_what_a_run_leaves_in_its_folder(recording) -> None:
    folder = recording.folder
    measured = read_measurements(folder.measurements)
    state = fold(recording.history)
    assert measured == state.measurements()
    assert len(measured) == 18
    assert state.identified
    result = json.loads(folder.result.read_text())
    assert {key: result[key] for key in state.identified.result} == state.identified.result
    assert result["findings"]
    proposal = Proposal.load(folder.proposal)
    assert proposal.text_before.encode() == recording.config_before
    assert proposal.text_after.encode() == recording.config_after
    assert Receipt.of(folder.path).backup() == recording.config_before


def test_held_out_deviations_shrink(recording) -> None:
    state = fold(recording.history)
    before, after = (np.linalg.norm(state.held_out(phase), axis=1) for phase in (Phase.BEFORE, Phase.AFTER))
    assert before.min() > 1.0
    assert after.max() < 0.1


GOOD = events.Gate(name="converged", passed=True, sentence="The solver ended well.")
FORBIDDEN = events.Gate(name="within tolerance", passed=False, sentence="Beyond: l3 (-13.00 mm).")
DOUBTFUL = events.Gate(name="small", passed=False, sentence="It is 20 mm.", needs_person=True)


def proposed(recording, *gates: events.Gate) -> list[events.Event]:
    return [*recording.until(events.Proposed)[:-1], events.Proposed(gates=gates)]


async def test_a_gate_that_forbids_ends_it_before_anything_is_written(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, FORBIDDEN, DOUBTFUL))
    with pytest.raises(LimitError, match=r"refused: Beyond: l3 \(-13\.00 mm\)\.$") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.OUT_OF_LIMITS
    assert rig.config == recording.config_before
    assert rig.operator.asked == []
    assert "reload" not in rig.controller.log


async def test_a_geometry_beyond_the_tolerance_is_refused(recording, replayed) -> None:
    measured = recording.until(events.SetClosed, count=4)
    rig = replayed(measured, tolerances__l_mm=2.0)
    with pytest.raises(LimitError, match="Beyond the drawing's tolerance: l"):
        await rig.run()
    assert rig.config == recording.config_before
    assert rig.folder.proposal.exists()


async def test_a_gate_that_needs_a_person_waits_for_one(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, DOUBTFUL))
    object.__setattr__(rig.performer, "operator", Nobody())
    with pytest.raises(AnswerNeeded, match=r"approval: It is 20 mm\.") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.ANSWER_NEEDED
    assert rig.config == recording.config_before
    assert Proposal.load(rig.folder.proposal).text_after.encode() == recording.config_after
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.ANSWER_NEEDED


async def test_a_large_change_needs_a_person(recording, replayed) -> None:
    measured = recording.until(events.SetClosed, count=4)
    rig = replayed(measured, acceptance__largest_change_mm=3.0)
    object.__setattr__(rig.performer, "operator", Nobody())
    with pytest.raises(AnswerNeeded, match=r"largest change is \d\.\d+ mm \(limit without a person 3 mm\)"):
        await rig.run()
    assert rig.config == recording.config_before


@pytest.mark.parametrize(("gates", "approval"), [([GOOD, DOUBTFUL], "automatic"), ([GOOD], "ask")])
async def test_a_person_may_approve(recording, replayed, gates, approval) -> None:
    rig = replayed(proposed(recording, *gates), acceptance__approval=approval)
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert happened(rig, events.Committed) == [events.Committed(approved_by="a tester")]
    assert rig.config == recording.config_after
    (asked,) = rig.operator.asked
    assert asked == (tuple(gates), Proposal.load(rig.folder.proposal).diff)


async def test_a_person_may_decline_and_approve_later(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD, DOUBTFUL))
    rig.operator.name = None
    with pytest.raises(LimitError, match="declined; nothing was applied"):
        await rig.run()
    assert rig.config == recording.config_before
    rig.operator.name = "a tester"
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert len(rig.operator.asked) == 2


async def test_within_limits_nobody_is_asked(recording, replayed) -> None:
    rig = replayed(proposed(recording, GOOD))
    await rig.run()
    assert rig.operator.asked == []
    (committed,) = happened(rig, events.Committed)
    assert committed.approved_by == "the cell file: within its limits"


def with_tiny_deviations_before(history) -> list[events.Event]:
    """As if the uncalibrated robot had been nearly perfect: whatever comes is worse."""
    return [
        event.model_copy(update={"deviation_mm": (0.0, 0.0, 1e-6)})
        if isinstance(event, events.Sampled) and event.at.phase is Phase.BEFORE
        else event
        for event in history
    ]


async def test_what_is_worse_is_rolled_back_bit_for_bit(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith("worse than before; rolled back, the controller is as it was")
    assert happened(rig, events.Judged)[0].verdict is Verdict.WORSE
    assert happened(rig, events.Committed)
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2
    assert commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0


def commanding(rig: Any) -> Any:
    """The geometry that the simulated controller commands with."""
    return rig.machine._geometry.geometry


async def test_what_is_better_but_out_of_limits_is_rolled_back_too(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed), acceptance__mean_deviation_mm=0.0001)
    assert (await rig.run()).exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.Judged)[0].verdict is Verdict.OUT_OF_LIMITS
    assert rig.config == recording.config_before


@pytest.mark.parametrize("key", ["after-V1/o01/sample", "after-V1/o02/sample", "after-V2/o03/sample"])
async def test_a_ball_outside_the_travel_afterwards_is_rolled_back(recording, replayed, key: str) -> None:
    rig = replayed(recording.until(events.Proposed))
    at_end = GaugeAtEnd("is at an end of its travel", subject="gauge x")
    fault = before_sampling(key, lambda: rig.gauges[0].failures.append(at_end))
    assert (await rig.run(fault)).exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.Judged)[0].verdict is Verdict.WORSE
    assert happened(rig, events.RolledBack)
    assert rig.config == recording.config_before


async def test_a_controller_that_does_not_take_it_gets_its_config_back(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone, match=r"did not take the new geometry .*as it was$") as undone:
        await rig.run()
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2, "the old config must be loaded again"
    assert not happened(rig, events.Committed)
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.WRITE_BACK_UNDONE


async def test_a_controller_in_an_unknown_state_is_said(recording, replayed, monkeypatch) -> None:
    rig = replayed(recording.until(events.Proposed))

    async def broken() -> None:
        raise DeviceError("connection lost", subject="controller")

    monkeypatch.setattr(rig.controller, "reload", broken)
    with pytest.raises(WriteBackUndone, match="Start the controller anew before it moves"):
        await rig.run()
    assert rig.config == recording.config_before


async def test_after_an_undone_write_back_it_may_be_tried_again(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")
    with pytest.raises(WriteBackUndone):
        await rig.run()
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after


def somebody_edits(rig: Any) -> bytes:
    config = rig.cell.config_path
    config.write_bytes(config.read_bytes() + b"# somebody was here\n")
    edited: bytes = config.read_bytes()
    return edited


@pytest.mark.parametrize("stage", ["measuring", "proposed"])
async def test_a_config_that_somebody_changed_meanwhile_is_left_alone(recording, replayed, stage) -> None:
    kind, count = {"measuring": (events.SetClosed, 4), "proposed": (events.Proposed, 1)}[stage]
    rig = replayed(recording.until(kind, count=count))
    edited = somebody_edits(rig)
    rig.controller.log.clear()
    with pytest.raises(FileError, match="changed since the run began") as refusal:
        # The run's own beginning stands in the journal: the config that it knows.
        await rig.run()
    assert refusal.value.exit_code is ExitCode.USAGE
    assert rig.config == edited
    assert "reload" not in rig.controller.log


async def test_rolling_back_does_not_lose_what_somebody_wrote(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    edited: list[bytes] = []
    edit = on(events.Judged, lambda: edited.append(somebody_edits(rig)))
    with pytest.raises(FileError, match="changed since it was written"):
        await rig.run(edit)
    assert [rig.config] == edited


async def test_a_roll_back_that_was_interrupted_is_finished(recording, replayed) -> None:
    rig = replayed(with_tiny_deviations_before(recording.until(events.Proposed)))
    broken = DeviceError("does not come back", subject="controller")
    fault = on(events.Judged, lambda: rig.controller.failures.update(reload=broken))
    with pytest.raises(DeviceError, match="does not come back"):
        await rig.run(fault)
    assert rig.config == recording.config_before
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert happened(rig, events.RolledBack)
    assert commanding(rig).largest_difference(rig.calibration.robot.controller) == 0.0


async def test_a_refused_record_is_chosen_anew_and_the_run_goes_on(make_rig) -> None:
    rig = make_rig()
    at_ends = [GaugeAtEnd("is at an end of its travel", subject=f"gauge {name}") for name in "xy"]

    def once() -> None:
        for gauge in rig.gauges[: len(at_ends)]:
            gauge.failures.append(at_ends.pop(0))

    ended = await rig.run(before_sampling("P1/o03/sample", once))
    assert ended.exit_code == ExitCode.DONE
    (refused,) = happened(rig, events.Refused)
    assert (str(refused.at), refused.orientation) == ("P1", 3)
    begun = [event.step for event in happened(rig, events.StepBegun)]
    first, second = (step.pose for step in begun if step.key == "P1/o03/move")
    assert first != second
    taken = next(event for event in happened(rig, events.Sampled) if event.orientation == 3)
    assert taken.pose == second


async def test_a_slipped_gauge_stops_the_run_and_the_point_is_measured_again(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=1))
    real = rig.gauges[1].shown

    def slip() -> None:
        rig.gauges[1].shown = lambda: real() + 0.2

    with pytest.raises(LimitError, match=r"P2: back at the reference .*y \+0\.[12]"):
        await rig.run(on(events.Sampled, slip, count=5))
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.OUT_OF_LIMITS
    assert rig.controller.log[-1] == "stop"
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    assert [str(event.at) for event in happened(rig, events.SetVoided)] == ["P2"]


async def test_a_gauge_that_falls_silent_stops_the_run(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=1))
    silent = GaugeSilent("does not answer", subject="gauge z")
    with pytest.raises(GaugeSilent):
        await rig.run(before_sampling("P2/o03/sample", lambda: rig.gauges[2].failures.append(silent)))
    assert rig.controller.log[-1] == "stop"
    assert happened(rig, events.Interrupted)[-1] == events.Interrupted(
        reason="gauge z: does not answer", exit_code=3
    )


async def test_gauges_by_hand_are_asked_for_at_every_point(recording, replayed) -> None:
    rig = replayed(recording.until(events.SetClosed, count=2), stations__placement="by-hand")
    await rig.run()
    assert rig.operator.placed == [1, 2, 1, 2]


async def test_with_nobody_there_to_carry_gauges_the_run_ends(make_rig) -> None:
    rig = make_rig(operator=Nobody(), stations__placement="by-hand")
    with pytest.raises(AnswerNeeded):
        await rig.run()
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.ANSWER_NEEDED
    assert [entry.split()[0] for entry in rig.controller.log] == ["prepare", "pose", "move", "stop"]


async def test_too_little_to_identify_is_said_and_nothing_is_written(make_rig) -> None:
    rig = make_rig(identification__orientations=3)
    before = rig.config
    with pytest.raises(HexacellError, match="12 equations for 35 parameters") as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.OUT_OF_LIMITS
    assert rig.config == before
    assert len(read_measurements(rig.folder.measurements)) == 6


async def test_a_check_measures_judges_and_changes_nothing(make_rig) -> None:
    rig = make_rig(Mode.CHECK)
    before = rig.config
    ended = await rig.run()
    assert ended.exit_code in {ExitCode.DONE, ExitCode.OUT_OF_LIMITS}
    assert "4 poses at held-out points" in ended.line
    assert rig.config == before
    assert "reload" not in rig.controller.log
    phases = {event.at.phase for event in happened(rig, events.Sampled)}
    assert phases == {Phase.BEFORE}
    computed = [
        event.step.kind for event in happened(rig, events.StepBegun) if isinstance(event.step, Compute)
    ]
    assert computed == ["judge"]


async def test_a_check_that_finds_too_much_says_so(make_rig) -> None:
    rig = make_rig(Mode.CHECK, acceptance__mean_deviation_mm=1e-6)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS
    assert ended.line.endswith("out of limits")


def test_samples_are_taken_only_where_the_robot_stands(recording) -> None:
    """Between a sample and the last arrival at its pose nothing has moved."""
    arrived = None
    for event in recording.history:
        if isinstance(event, events.Arrived):
            arrived = event
        if isinstance(event, events.StepBegun) and isinstance(event.step, Sample):
            assert arrived is not None
            assert (arrived.at, arrived.orientation) == (event.step.at, event.step.orientation)
            assert arrived.pose == event.step.pose
