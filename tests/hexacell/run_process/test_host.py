"""A run in a host: told whole, paused when its terminal is gone, ended when nobody comes back."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.loader import Cell
from hexacell.errors import ExitCode
from hexacell.run_process import messages
from hexacell.run_process.host import RemoteOperator, RunHost
from hexacell.run_process.run_socket import listening_socket
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.calibration_run import RunRequest
from procedures.calibration.calibration import Mode
from procedures.engine.command_loop import Status
from procedures.engine.commands import Answer, CommandQueue, Resume
from procedures.journal.journal import read_entries, read_journal
from procedures.run.questions import GaugePlacement, StepFailure
from procedures.steps import events
from tests.hexacell.run_process.conftest import Client, Connected
from tests.hexacell.services.conftest import maker
from tests.small_cell import few_candidates
from tests.waiting import until


@pytest.fixture(autouse=True)
def quick_choices() -> Iterator[None]:
    with few_candidates():
        yield


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return maker(tmp_path)(stations__placement="by-hand")


class HostedRun(Connected):
    """A host in this process, and its clients."""

    def __init__(self, cell: Cell, path: Path, resume: bool) -> None:
        super().__init__(path)
        self.folder = RunFolder(runs_folder(cell) / "run")
        request = RunRequest(cell, self.folder, Mode.OPTIMISE, RemoteOperator(), resume=resume)
        self.host = RunHost(request, CommandQueue())
        self.serving: asyncio.Future[ExitCode] = asyncio.get_running_loop().create_future()

    @property
    def history(self) -> tuple[events.Event, ...]:
        return read_journal(self.folder.journal)


Hosted = Callable[..., AbstractAsyncContextManager[HostedRun]]


@pytest.fixture
def hosted(path: Path, cell: Cell) -> Hosted:
    @asynccontextmanager
    async def run(away_minutes: float = 30.0, *, resume: bool = False) -> AsyncIterator[HostedRun]:
        away = cell.settings.recovery.model_copy(update={"away_minutes": away_minutes})
        settings = cell.settings.model_copy(update={"recovery": away})
        hosted = HostedRun(replace(cell, settings=settings), path, resume)
        with listening_socket(path) as listener:
            hosted.serving = asyncio.ensure_future(hosted.host.serve(listener))
            try:
                yield hosted
                await hosted.serving
            finally:
                hosted.serving.cancel()
                await asyncio.wait([hosted.serving])
                hosted.close()

    return run


def asks(kind: type) -> Callable[[messages.HostMessage], bool]:
    return lambda one: (
        isinstance(one, messages.QuestionChanged)
        and one.question is not None
        and isinstance(one.question.subject, kind)
    )


def is_status(status: Status) -> Callable[[messages.HostMessage], bool]:
    return lambda one: one == messages.StatusChanged(status=status)


def told_of(kind: type[Any]) -> Callable[[messages.HostMessage], bool]:
    return lambda one: isinstance(one, messages.EventRecorded) and isinstance(one.event, kind)


def history_told(client: Client) -> list[events.Event]:
    return [one.event for one in client.told if isinstance(one, messages.EventRecorded)]


async def answer_all(client: Client) -> None:
    """Put gauges in place and approve everything, to the end of the run."""
    answers = {GaugePlacement: "placed", StepFailure: "abort"}
    async for message in client._messages:
        client.told.append(message)
        if isinstance(message, messages.QuestionChanged) and message.question is not None:
            await client.connection.give(Answer(answers.get(type(message.question.subject), "a tester")))


async def place(client: Client) -> None:
    await client.until(asks(GaugePlacement))
    await client.connection.give(Answer("placed"))


@pytest.mark.slow
async def test_a_whole_run_is_told_and_commanded_over_the_socket(hosted) -> None:
    async with hosted() as run:
        client = await run.client()
        await answer_all(client)
        assert await run.serving is ExitCode.DONE
    described = client.told[0]
    assert isinstance(described, messages.RunDescribed)
    assert (described.folder, described.is_recorded) == (run.folder.path, False)
    assert history_told(client) == list(run.history)
    assert [one.sequence for one in client.told if isinstance(one, messages.EventRecorded)] == [
        entry.number for entry in read_entries(run.folder.journal)
    ]
    questions = [one.question for one in client.told if isinstance(one, messages.QuestionChanged)]
    assert 2 * questions.count(None) == len(questions)
    assert messages.StatusChanged(status=Status.ENDED) in client.told


async def test_a_second_client_is_told_the_same_and_the_open_question(hosted) -> None:
    async with hosted() as run:
        first = await run.client()
        await first.until(asks(GaugePlacement))
        second = await run.client()
        await second.until(asks(GaugePlacement))
        assert history_told(second) == history_told(first) == list(run.history)
        assert messages.StatusChanged(status=Status.AWAITING_OPERATOR) in second.told
        await second.connection.take_control()
        await second.connection.give(Answer("placed"))
        await first.until(told_of(events.GaugesPlaced))
        await second.connection.leave(keep_running=False)
        await first.until_over()
    assert isinstance(run.history[-1], events.Interrupted)


async def test_where_the_terminal_is_gone_the_record_is_finished_and_the_run_pauses(hosted) -> None:
    async with hosted() as run:
        lost = await run.client()
        await place(lost)
        await lost.until(told_of(events.GaugesPlaced))
        await lost.until(lambda one: isinstance(one, messages.EventRecorded) and "sample" in str(one.event))
        lost.hang_up()
        await until(lambda: not run.host._audience.is_controlled)
        back = await run.client()
        await back.until(is_status(Status.PAUSED))
        steps = [event for event in history_told(back) if not isinstance(event, events.StepBegun)]
        assert isinstance(steps[-1], events.Paused)
        assert not steps[-1].at_once
        assert isinstance(steps[-2], events.RecordTaken | events.Located)
        await back.connection.give(Resume())
        await back.until(told_of(events.Resumed))
        await back.until(told_of(events.RecordTaken))
        await back.connection.leave(keep_running=False)


async def test_who_leaves_it_running_finds_it_running(hosted) -> None:
    async with hosted() as run:
        client = await run.client()
        await place(client)
        await client.until(told_of(events.RecordTaken))
        known = len(history_told(client))
        await client.connection.leave(keep_running=True)
        await until(lambda: not run.host._audience.is_controlled)
        back = await run.client()
        await back.until_control(
            is_in_control=True
        )  # told after the history, which may be of the whole set
        if not any(isinstance(event, events.RecordTaken) for event in history_told(back)[known:]):
            await back.until(told_of(events.RecordTaken))
        await back.connection.leave(keep_running=False)
    assert not any(isinstance(event, events.Paused) for event in run.history)


async def test_where_nobody_comes_back_it_ends_and_is_resumed(hosted) -> None:
    async with hosted(away_minutes=1e-6) as run:
        lost = await run.client()
        await place(lost)
        await lost.until(told_of(events.RecordTaken))
        lost.hang_up()
        assert await run.serving is ExitCode.INTERRUPTED
    before = run.history
    assert before[-1] == events.Interrupted(reason="nobody was connected for 1e-06 minutes", exit_code=130)
    assert any(isinstance(event, events.Paused) for event in before)
    async with hosted(resume=True) as resumed:
        client = await resumed.client()
        await client.until(
            lambda one: told_of(events.RecordTaken)(one) and len(history_told(client)) > len(before)
        )
        assert history_told(client)[: len(before)] == list(before)
        await client.connection.leave(keep_running=False)


async def test_nothing_begins_before_somebody_is_there(hosted, monkeypatch) -> None:
    monkeypatch.setattr("hexacell.run_process.host.FIRST_CLIENT_S", 0.0)
    async with hosted() as run:
        assert await run.serving is ExitCode.INTERRUPTED
    assert not run.folder.path.exists()
