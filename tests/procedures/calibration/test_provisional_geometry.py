"""A provisional geometry: applied between two points, and always reverted."""

from typing import Any

import numpy as np
import pytest

from hexacell.config.toml_format import native_layout
from hexacell.errors import DeviceError, ExitCode, HexacellError, Interruption
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from procedures.engine.commands import Abort
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.rig import failure_without_record
from tests.procedures.runs.listening import PowerCut, happened, on


@pytest.fixture
def rig(recording, replayed) -> Any:
    """The first point is measured: what may be lent is lent now."""
    return replayed(recording.until(events.SetClosed, count=1), identification__provisional=True)


def kinds(rig: Any) -> list[str]:
    wanted = {"lent", "taken back", "identified", "committed", "interrupted", "ended"}
    return [event.kind for event in read_journal(rig.folder.journal) if event.kind in wanted]


async def test_a_provisional_geometry_is_applied_after_the_first_point_and_reverted_before_identification(
    rig,
) -> None:
    before = rig.config
    configs: dict[str, bytes] = {}

    def look(event: events.Event, _: Any) -> None:
        configs.setdefault(event.kind, rig.config)

    ended = await rig.run(look)
    assert ended.exit_code == ExitCode.DONE
    before_that, *now = kinds(rig)
    assert before_that == "interrupted", "the first point was measured by a run that ended without a word"
    assert now == ["lent", "taken back", "identified", "committed", "ended"]
    assert configs["lent"] != before
    assert configs["taken back"] == configs["proposed"] == before
    closed = [e.kind for e in read_journal(rig.folder.journal) if e.kind in {"closed", "lent"}]
    assert closed[:3] == ["closed", "lent", "closed"]


async def test_a_provisional_geometry_is_closer_to_the_truth_than_the_drawing(rig) -> None:
    lent: list[Geometry] = []

    def look() -> None:
        lent.append(native_layout(HEXAGLIDE_PARAMETERS).read(rig.cell.config_path).geometry)
        rig.engine.queue.put(Abort())

    with pytest.raises(Interruption):
        await rig.run(on(events.ProvisionalApplied, look))
    truth = rig.physics._truth
    mechanism = rig.calibration.robot.mechanism
    free = [
        mechanism.convention.free_parameters(mechanism.normalize_frames(geometry)[0])
        for geometry in (rig.calibration.robot.controller, lent[0], truth)
    ]
    drawn, better = (float(np.linalg.norm(one - free[2])) for one in free[:2])
    assert better < drawn


async def require_finished(rig: Any) -> None:
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    lent = [event.geometry for event in happened(rig, events.ProvisionalApplied)]
    assert lent.count(lent[0]) == len(lent)
    assert kinds(rig)[-3:] == ["identified", "committed", "ended"]
    assert "taken back" in kinds(rig)
    state = fold(read_journal(rig.folder.journal))
    assert [len(measured.samples) for measured in state.sets.values()] == [9, 9, 3, 3, 5, 5]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "count"), [(events.SetClosed, 1), (events.RecordTaken, 2), (events.RecordTaken, 5)]
)
async def test_an_abort_reverts_the_provisional_geometry_at_a_reference_and_otherwise_when_resumed(
    rig, kind, count
):
    before = rig.config
    with pytest.raises(Interruption):
        await rig.run(on(kind, lambda: rig.engine.queue.put(Abort()), count))
    assert (rig.config == before) is (kind is events.SetClosed)
    await require_finished(rig)


async def test_a_run_resumes_after_a_power_cut_with_the_provisional_geometry_written(rig, monkeypatch):
    before = rig.config

    kept: list[bytes] = []

    async def dies(permitted: object) -> None:
        kept.extend([rig.folder.journal.read_bytes(), rig.config])
        raise PowerCut

    with monkeypatch.context() as patch:
        patch.setattr(rig.performer.devices.controller, "reload", dies)
        with pytest.raises(PowerCut):
            await rig.run()
    journal, config, *_ = kept
    rig.folder.journal.write_bytes(journal)
    rig.cell.config_path.write_bytes(config)
    assert config != before, "the file was replaced, and nobody had time to say so"
    assert "lent" not in kinds(rig)
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE


async def test_a_provisional_geometry_that_cannot_be_loaded_leaves_the_config_unchanged(rig) -> None:
    before = rig.config
    rig.controller.failures["reload"] = DeviceError("cannot be read", subject="controller")
    with pytest.raises(HexacellError, match="did not take the provisional geometry"):
        await rig.run()
    assert rig.config == before


@pytest.mark.sample("True")
@pytest.mark.parametrize("reload_works", [True, False])
async def test_a_provisional_geometry_that_cannot_be_journalled_is_reverted_or_reported(
    rig, monkeypatch, reload_works: bool
) -> None:
    before = rig.config
    report = await failure_without_record(
        rig, monkeypatch, events.ProvisionalApplied, reload_works=reload_works
    )
    unreverted = "the controller has a provisional geometry, which could be neither noted nor taken back"
    assert (unreverted in report) is not reload_works
    assert rig.config == before
    rig.controller.failures.clear()
    await require_finished(rig)
