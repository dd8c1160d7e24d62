"""Gauges that do not answer as they are mounted are named before anything is measured with them."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.errors import GaugeSilent
from hexacell.cell.recovery import Action
from hexacell.errors import ExitCode, HexacellError, LimitError
from procedures.engine.recovery import RecoveryPolicy
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from procedures.steps.move import Move
from tests.procedures.runs.gauge_mistakes import MISTAKES, corrected, make_mistake
from tests.procedures.runs.listening import at_step, happened, on, run_until, steps_of

P1 = SetKey(phase=Phase.IDENTIFY, point=1)


@pytest.mark.parametrize("mistake", MISTAKES)
async def test_a_mistake_is_named_at_the_first_station(make_rig, mistake: str) -> None:
    rig = make_rig(stations__trial_mm=1.0)
    make_mistake(rig, mistake)
    with pytest.raises(HexacellError, match=MISTAKES[mistake]) as refusal:
        await rig.run()
    assert refusal.value.exit_code is ExitCode.HARDWARE
    assert {event.at for event in happened(rig, events.RecordTaken)} == {P1}
    assert len(happened(rig, events.RecordTaken)) == 1, "only the zero was recorded"
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.HARDWARE


async def test_a_person_puts_it_right_and_the_station_begins_again(make_rig) -> None:
    rig = make_rig(stations__trial_mm=1.0, stations__placement="by-hand")
    make_mistake(rig, "x and y exchanged")
    rig.operator.decisions = [Action.REDO_SET]
    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=True)
    await run_until(
        rig, events.GaugesPlaced, on(events.Failed, lambda: corrected(rig)), count=3, policy=policy
    )
    (problem,) = rig.operator.problems
    assert "gauges x, y: are exchanged" in problem
    assert "Exchange their cables" in problem
    assert rig.operator.placed[:3] == [1, 1, 2]


async def test_every_station_is_tried_once(make_rig) -> None:
    rig = make_rig(stations__trial_mm=1.0)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    tried = [str(event.at) for event in happened(rig, events.GaugesTried)]
    assert tried == ["P1", "P2", "before-V1", "before-V2", "after-V1", "after-V2"]
    assert len(happened(rig, events.GaugesProbed)) == 3 * len(tried)
    trial = ["P1/o01/sample", *["P1/o00/move", "P1/probe"] * 3, "P1/o01/move", "P1/try"]
    begun = [step.key for step in steps_of(rig)]
    assert begun[begun.index("P1/o01/sample") :][: len(trial)] == trial
    lengths = [
        np.abs(np.subtract(step.pose[:3], (100.0, -100.0, 500.0))).max()
        for step in steps_of(rig)
        if isinstance(step, Move) and step.at == P1 and step.orientation == 0
    ]
    assert lengths[:3] == pytest.approx([1.0] * 3)


async def test_a_gauge_that_was_connected_again_is_tried_again(make_rig) -> None:
    rig = make_rig(stations__trial_mm=1.0)
    rig.right_gauges = {}
    silences = [GaugeSilent("does not answer", subject="gauge z")] * 2

    def turned_round() -> None:
        if silences:
            rig.gauges[2].failures.append(silences.pop())
        if not silences and not rig.right_gauges:
            make_mistake(rig, "z reversed")

    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=False)
    with pytest.raises(HexacellError, match="gauge z: counts the wrong way"):
        await rig.run(at_step("P1/o03/sample", turned_round), policy=policy)
    assert [str(event.at) for event in happened(rig, events.GaugesTried)] == ["P1"]
    assert happened(rig, events.SetInvalidated), "its zero was void"


async def test_after_an_interruption_the_gauges_are_tried_again_before_the_set_continues(make_rig):
    rig = make_rig(stations__trial_mm=1.0)

    def stop() -> None:
        raise LimitError("stop here")

    with pytest.raises(LimitError, match="stop here"):
        await rig.run(at_step("P1/o04/sample", stop))
    await run_until(rig, events.SetClosed)
    history = read_journal(rig.folder.journal)
    confirmed = next(n for n, event in enumerate(history) if isinstance(event, events.ReferenceConfirmed))
    after = [event.step.key for event in history[confirmed:] if isinstance(event, events.StepBegun)]
    assert after[:8] == [*["P1/o00/move", "P1/probe"] * 3, "P1/o01/move", "P1/try"]
    records = [event.orientation for event in history if isinstance(event, events.RecordTaken)][:9]
    assert records == [1, 2, 3, 4, 5, 6, 7, 8, 9]
