"""A whole cell without wires: the simulated robot, on a clock that jumps, behind devices that obey.

What moves and what is measured is the simulation's own truth; only the protocols are left out, so
that a whole run takes as long as its mathematics and nothing depends on the machine's clock.
"""

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import ConfigChange
from hexacell.config.write_back import commit
from procedures.calibration.calibration import Calibration
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.made_once import made_once
from tests.procedures.fakes import Bench
from tests.procedures.rig import MakeRig, Recording, Rig, new_rig
from tests.procedures.story import Story
from tests.small_cell import choose_among_few


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose among few poses, go there in few pieces: what is chosen is not under test here."""
    choose_among_few(monkeypatch)


@pytest.fixture
def make_rig(few_candidates: None, tmp_path: Path) -> MakeRig:
    return partial(new_rig, tmp_path)


@pytest.fixture(scope="session")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    """What a run of the recorded cell decides by, for tests that take no step."""
    return new_rig(tmp_path_factory.mktemp("cell")).calibration


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return made_once(tmp_path_factory, "recording", recorded_in)


def recorded_in(folder: Path) -> Recording:
    with pytest.MonkeyPatch.context() as patch:
        choose_among_few(patch)
        rig = new_rig(folder)
        before = rig.config
        told: list[events.Event] = []
        asyncio.run(rig.run(lambda event, _: told.append(event)))
    return Recording(tuple(told), tuple(rig.controller.log), before, rig.config, rig.folder)


@pytest.fixture
def replayed(recording: Recording, make_rig: MakeRig) -> Callable[..., Rig]:
    """A rig of the recorded cell in whose folder a part of the recorded run has happened already."""

    def make(history: Sequence[events.Event], **changes: Any) -> Rig:
        rig = make_rig(**changes)
        started = rig.started()
        rig.write([started if isinstance(event, events.RunStarted) else event for event in history])
        kinds = {type(event) for event in history}
        if events.Proposed in kinds:
            moved = str(recording.folder.path.parent), str(rig.folder.path.parent)
            rig.folder.proposal.write_text(recording.folder.proposal.read_text().replace(*moved))
        if events.Committed in kinds:
            commit(ConfigChange.load(rig.folder.proposal), rig.folder.path)
            rig.machine.switch_on()
        return rig

    return make


@pytest.fixture
def story() -> Callable[..., Story]:
    def make(phase: Phase = Phase.IDENTIFY, point: int = 1) -> Story:
        return Story(SetKey(phase=phase, point=point))

    return make


@pytest.fixture
def bench() -> Bench:
    return Bench()
