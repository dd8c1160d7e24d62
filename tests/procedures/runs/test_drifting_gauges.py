"""Gauges whose mounts drift: the run says so once, and the way of their zero is data."""

import asyncio
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.pilots import FIRST_REPEAT
from hexacell.errors import Interruption
from hexacell.identification.problem.random_walk import GaugeWalk
from hexacell.kinematics.pose import Pose
from hexacell.measurements.csv_file import read_measurements
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.replay.test_replayer import through
from tests.procedures.rig import MakeRig
from tests.procedures.runs.listening import happened, on, stop_here


@pytest.mark.slow
async def test_they_are_noticed_and_references_read_again_become_records(make_rig: MakeRig, tmp_path: Path):
    noise: dict[str, Any] = {"noise__standstill_readings": 16, "noise__revisits": 6}
    noise["identification__orientations"] = 20
    rig = make_rig(simulation__seed=10, simulation__gauges__drift_um=10.0, **noise)
    with pytest.raises(Interruption):
        await rig.run(on(events.Identified, stop_here))
    history = read_journal(rig.folder.journal)
    state, (first, second) = fold(history), happened(rig, events.SetClosed)
    assert first.walk_mm == 0.0, "one set may be of a gauge that slipped"
    assert 0.002 < second.walk_mm < 0.02
    assert 5.0 < 1e3 * second.walk_mm / np.sqrt(second.walk_s / 60.0) < 25.0, "as simulated, a minute"
    assert (np.diff(state.measurements().times_s) > 0.0).all()
    told = [event.text(state) or "" for event in (first, second)]
    assert ["the gauges drift" in text for text in told] == [False, True]
    labels = [record.id for record in state.measurements().records]
    again = [(1, FIRST_REPEAT + number) for number in range(6)]
    taken = [(1, number) for number in range(2, 21)]
    assert labels[:28] == [(1, 1), *again, *taken, (1, FIRST_REPEAT + 6), (2, 1)]
    assert labels[-1] == (2, FIRST_REPEAT)
    assert state.identified is not None
    assert state.identified.result.records == len(labels) == 48
    assert read_measurements(rig.folder.measurements) == state.measurements()
    known = rig.calibration.known(state)
    reference, slipped = Pose(*state.sets[first.at].samples[0].pose), 0.15 * np.eye(9)[0]
    change = partial(known.allowances.since, reference, np.zeros(9), slipped, None)
    assert [change(readings).exceeds(0.1) for readings in (0, 100)] == [True, False], (
        "a drift explains more"
    )
    found = known.robot_of(state).noise
    assert found.walk == (second.walk_mm, second.walk_s)
    assert found.gauge_mm == pytest.approx(0.0012, rel=0.01), "what drifted between the visits is no noise"
    denied = replace(known, walk=GaugeWalk(1e-6)).robot_of(state).noise
    assert denied.walk.step_mm == 0.0, "residuals that a drift does not explain are of something else"
    report = await asyncio.to_thread(through, rig, history, tmp_path / "again")
    assert report.differences == []
