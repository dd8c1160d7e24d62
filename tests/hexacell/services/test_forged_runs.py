"""A run folder that was forged, its checksums right, is refused before anything moves or is written."""

from collections.abc import Callable
from typing import Any

import pytest

from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.config.interface import ControllerLimits
from hexacell.errors import FileError, HexacellError
from hexacell.services.run.replay_run import replay
from procedures.journal.journal import Journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.recorded_events import record

History = list[Any]
Forgery = Callable[[History], None]
STARTED = events.RunStarted


def changed(history: History, kind: type[Any], **changes: Any) -> None:
    """The last event of a kind with other fields."""
    place = max(n for n, event in enumerate(history) if isinstance(event, kind))
    history[place] = history[place].model_copy(update=changes)


def other(kind: type[Any], **changes: Any) -> Forgery:
    return lambda history: changed(history, kind, **changes)


def result_changed(history: History, **changes: Any) -> None:
    identified = next(event for event in history if isinstance(event, events.Identified))
    changed(history, events.Identified, result=identified.result.model_copy(update=changes))


def scaled(geometry: dict[str, Any], factor: float) -> dict[str, Any]:
    return {**geometry, "l": tuple(factor * one for one in geometry["l"])}


def reading_changed(history: History, **changes: Any) -> None:
    taken = next(event for event in reversed(history) if isinstance(event, events.RecordTaken))
    changed(history, events.RecordTaken, reading=taken.reading.model_copy(update=changes))


def first_taken(history: History) -> events.RecordTaken:
    return next(event for event in history if isinstance(event, events.RecordTaken))


def pilot_taken(history: History, orientation: int) -> events.PilotTaken:
    taken = first_taken(history)
    return events.PilotTaken(at=taken.at, orientation=orientation, pose=taken.pose, reading=taken.reading)


FAR = (0.0, 0.0, 5500.0, 0.0, 0.0, 0.0)
TILTED = (0.0, 0.0, 550.0, 0.0, 46.0, 0.0)
V9 = SetKey(phase=Phase.BEFORE, point=9)

FORGERIES: list[tuple[Forgery, str]] = [
    (lambda h: changed(h, STARTED, controller=scaled(h[0].controller, 1.01)), "another geometry than"),
    (other(STARTED, joint_ranges=((-800.0, 800.0),) * 6), "states other limits than"),
    (other(STARTED, limits=ControllerLimits(axes=((-1e3, 1e3),) * 6)), "states other limits than"),
    (other(STARTED, limits=ControllerLimits(axes=((-1.0, 1.0),) * 5)), "there are 5 axes, not 6"),
    (other(STARTED, joint_ranges=((-800.0, 200.0),) * 5), "there are 5 joint ranges, not 6"),
    (other(STARTED, controller={"S": ((1.0, 2.0),)}), "a geometry has other parameters"),
    (lambda h: changed(h, STARTED, controller=scaled(h[0].controller, 0.0)), "not above zero"),
    (other(events.Identified, held_out=((FAR, FAR), (FAR, FAR))), "0, 0, 5500, 0, 0, 0, which the robot"),
    (other(events.Identified, held_out_after=((TILTED,), (TILTED,))), "which the robot cannot take"),
    (other(events.Identified, held_out=((FAR,),)), "are not those of the cell file's points"),
    (other(events.RecordTaken, at=V9), "the cell file has no held-out point 9"),
    (lambda h: h.append(first_taken(h)), "orientation 1 is not the next one"),
    (lambda h: h.append(pilot_taken(h, FIRST_PILOT + 1)), "preliminary pose 2 is not the next one"),
    (lambda h: reading_changed(h, gauges_mm=(float("nan"), 0.0, 0.0)), "nan is not within"),
    (lambda h: reading_changed(h, counts=((1, 2, 3, 4, 5),)), "the encoders have other counts"),
    (lambda h: reading_changed(h, at_s=-1.0), "no time of a run"),
    (lambda h: result_changed(h, covariance=((1.0,),)), "a covariance has another size"),
    (lambda h: result_changed(h, covariance=((-1.0,) * 42,) * 42), "this is no covariance"),
    (lambda h: h.append(events.Committed(approved_by="me")), "nothing that it follows from"),
    (lambda h: h.append(h[0]), "the run was started before"),
]


async def refusal_of(site: Any) -> str:
    """Why a run is not resumed; nothing has moved, and the config is as it was."""
    joints, config = site.simulated.machine.joints(), site.config
    with pytest.raises(HexacellError) as refused:
        await site.calibrate(resume=True)
    assert isinstance(refused.value, FileError)
    assert site.simulated.machine.joints() == joints
    assert site.config == config
    return str(refused.value)


@pytest.mark.parametrize(("forge", "words"), FORGERIES, ids=[words for _, words in FORGERIES])
async def test_a_forged_journal_is_refused(finished, make_site, forge: Forgery, words: str) -> None:
    site = make_site()
    site.write(finished.until(events.Identified), moved_from=finished)
    history: History = list(finished.until(events.Identified))
    history[0] = history[0].model_copy(update={"cell_text": site.cell.text})
    forge(history)
    site.folder.journal.unlink()
    record(site.folder.journal, history)
    assert words in await refusal_of(site)


@pytest.mark.parametrize("name", ["proposal.json", "write-back.json", "lent/write-back.json"])
async def test_a_file_that_names_another_config_leads_nowhere(finished, make_site, tmp_path, name) -> None:
    """Otherwise a rollback, or a proposal, would be written there."""
    victim = tmp_path / "victim"
    victim.write_bytes(finished.config_before)
    site = make_site()
    site.write(finished.until(events.Committed), moved_from=finished)
    kept = "write-back.json" if name.startswith("lent") else name
    text = (finished.folder.path / kept).read_text()
    path = site.folder.path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text.replace(str(finished.cell.config_path), str(victim)))
    assert f"{name}: is for another config, {victim}" in await refusal_of(site)
    assert victim.read_bytes() == finished.config_before


@pytest.mark.parametrize("name", ["result.json", "measurements.csv", "wire", "lent"])
async def test_a_link_in_a_run_folder_is_not_followed(finished, make_site, tmp_path, name: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir() if name == "lent" else elsewhere.write_text("precious")
    site = make_site()
    site.write(finished.until(events.Identified), moved_from=finished)
    (site.folder.path / name).symlink_to(elsewhere)
    assert f"{name}: is a link" in await refusal_of(site)
    assert elsewhere.is_dir() or elsewhere.read_text() == "precious"


def test_a_journal_that_is_a_link_is_not_appended_to(tmp_path) -> None:
    (tmp_path / "elsewhere").touch()
    (tmp_path / "journal.jsonl").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileError, match="the journal cannot be opened"):
        Journal(tmp_path / "journal.jsonl")


async def test_a_replay_opens_no_list_of_poses_that_the_journal_only_names(finished, tmp_path) -> None:
    history: History = list(finished.history)
    text = history[0].cell_text.replace("[identification]\n", '[identification]\nposes = "/etc/passwd"\n')
    history[0] = history[0].model_copy(update={"cell_text": text})
    record(tmp_path / "journal.jsonl", history)
    with pytest.raises(FileError, match="names a list of poses, /etc/passwd, and does not have it"):
        await replay(tmp_path)


async def test_a_replay_of_a_forged_journal_is_refused_with_its_line(finished, tmp_path) -> None:
    history: History = list(finished.history)
    changed(history, events.Arrived, pose=(1e308,) * 6)
    record(tmp_path / "journal.jsonl", history)
    line = 1 + max(n for n, event in enumerate(history) if isinstance(event, events.Arrived))
    with pytest.raises(FileError, match=r"1e\+308 is not within") as refused:
        await replay(tmp_path)
    assert refused.value.line == line
