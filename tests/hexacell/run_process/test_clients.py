"""Clients of a run: who gives commands, who is gone, slow, or leaves."""

import asyncio
import os
import socket

import pytest

from hexacell.errors import FileError
from hexacell.run_process.client import LOST, HostConnection, connect_to_run
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot
from hexacell.run_process.messages import (
    ClientMessage,
    ControlChanged,
    GiveCommand,
    HostFailed,
    HostMessage,
    Leave,
    StatusChanged,
    client_message,
    message_line,
)
from procedures.engine.command_loop import Status
from procedures.engine.commands import MeasureAgain, Pause, Resume, Undo
from procedures.run.keys import Phase, SetKey
from tests.hexacell.run_process.conftest import FIRST
from tests.waiting import until

BULKY = HostFailed(problem="x" * 20_000)
"""A message of which a few hundred fill every buffer between two processes."""


def numbered(number: int) -> LiveSnapshot:
    return LiveSnapshot(gauges=(GaugeSnapshot(name="x", axis="x", shown_mm=number, travel_mm=12.5),))


async def test_the_first_client_gives_the_commands(scripted_run, path) -> None:
    assert await connect_to_run(path) is None, "there is no run"
    async with scripted_run() as run:
        client = await run.client()
        control = await client.until_control(is_in_control=True)
        assert client.told == [FIRST, control]
        assert control.who.endswith(f"process {os.getpid()}")
        assert await run.calls.get() == "control"
        commands = [Undo(), Pause(at_once=True), MeasureAgain(SetKey(phase=Phase.AFTER, point=2), 3)]
        for command in commands:
            await client.connection.give(command)
        assert [await run.calls.get() for _ in commands] == commands


async def test_others_watch_until_they_take_control(scripted_run) -> None:
    async with scripted_run() as run:
        first, second = await run.client(), await run.client()
        await first.until_control(is_in_control=True)
        await second.until_control(is_in_control=False)
        await second.connection.give(Undo())
        refusal = await second.until(lambda one: isinstance(one, HostFailed))
        assert refusal.problem.startswith("Undo: ")
        assert refusal.problem.endswith("is in control of this run")
        assert (refusal.action, refusal.exit_code) == ("Take control first", None)
        await second.connection.take_control()
        await second.until_control(is_in_control=True)
        await first.until_control(is_in_control=False)
        await second.connection.give(Resume())
        assert [await run.calls.get() for _ in range(3)] == ["control", "control", Resume()]
        await first.connection.give(Undo())
        await first.until(lambda one: isinstance(one, HostFailed))
        assert run.calls.empty()
        run.audience.send(StatusChanged(status=Status.RUNNING))
        for client in (first, second):
            await client.until(lambda one: one == StatusChanged(status=Status.RUNNING))


async def test_fifty_clients_are_told_all_and_one_commands_whoever_hangs_up(scripted_run) -> None:
    told = [FIRST, *(StatusChanged(status=status) for status in (Status.RUNNING, Status.PAUSED))]
    async with scripted_run() as run:
        clients = [await run.client() for _ in range(50)]
        for client in clients:
            await client.until_control(is_in_control=client is clients[0])
        for client in clients[1::2]:
            client.hang_up()
        for message in told[1:]:
            run.audience.send(message)
        for client in clients[::2]:
            await client.until(lambda one: one == told[-1])
            assert [one for one in client.told if isinstance(one, StatusChanged)] == told
        await clients[0].connection.give(Undo())
        assert [await run.calls.get() for _ in range(2)] == ["control", Undo()]


@pytest.mark.parametrize("keep_running", [True, False])
async def test_who_leaves_says_whether_the_run_goes_on(scripted_run, keep_running: bool) -> None:
    async with scripted_run() as run:
        client = await run.client()
        await client.until_control(is_in_control=True)
        await client.connection.leave(keep_running=keep_running)
        assert [await run.calls.get() for _ in range(2)] == ["control", ("left", keep_running)]
        assert not run.audience.is_controlled


async def test_a_watcher_leaves_unnoticed(scripted_run) -> None:
    async with scripted_run() as run:
        first, second = await run.client(), await run.client()
        await second.until_control(is_in_control=False)
        await second.connection.leave(keep_running=True)
        await second.until_over()
        assert [run.calls.get_nowait() for _ in range(run.calls.qsize())] == ["control"]
        assert run.audience.is_controlled
        assert not first.is_over


async def test_who_is_gone_without_a_word_is_missed(scripted_run) -> None:
    async with scripted_run() as run:
        first, second = await run.client(), await run.client()
        await second.until_control(is_in_control=False)
        await first.until_control(is_in_control=True)
        first.hang_up()
        assert [await run.calls.get() for _ in range(2)] == ["control", "lost"]
        nobody = await second.until(lambda one: isinstance(one, ControlChanged))
        assert nobody == ControlChanged(is_in_control=False, who="")
        third = await run.client()
        await third.until_control(is_in_control=True)
        assert await run.calls.get() == "control"


async def test_nonsense_is_refused_half_a_command_is_none_and_the_run_goes_on(scripted_run) -> None:
    async with scripted_run() as run:
        client = await run.client()
        for line in (b"\n", b"{}\n", b"\xff\xfe\n", b'{"kind":"leave"}\n'):
            client.connection._writer.write(line)
            refusal = await client.until(lambda one: isinstance(one, HostFailed))
            assert "is not understood" in refusal.problem
        await client.connection.give(Undo())
        assert [await run.calls.get() for _ in range(2)] == ["control", Undo()]
        client.connection._writer.write(message_line(GiveCommand(command=Undo()))[:-1])
        await client.connection._writer.drain()
        client.connection._writer.close()
        assert await run.calls.get() == "lost"


async def test_a_slow_client_misses_snapshots_and_no_events(scripted_run) -> None:
    async with scripted_run() as run:
        client = await run.client()
        await client.until_control(is_in_control=True)
        statuses = [Status.RUNNING, Status.PAUSED] * 10
        for number in range(1000):
            run.audience.send_latest(numbered(number))
            run.audience.send(BULKY)
            if number % 50 == 0:
                run.audience.send(StatusChanged(status=statuses[number // 50]))
            await asyncio.sleep(0)
        await client.until(lambda one: one == numbered(999))
        told = client.told
        assert [one.status for one in told if isinstance(one, StatusChanged)] == [Status.IDLE, *statuses]
        assert told.count(BULKY) == 1000
        shown = [one.gauges[0].shown_mm or 0.0 for one in told if isinstance(one, LiveSnapshot)]
        assert len(shown) < 500
        assert shown == sorted(shown)


async def test_a_stuck_client_is_let_go_and_delays_nobody(scripted_run, path) -> None:
    async with scripted_run(stuck_s=0.2) as run:
        stuck = socket.socket(socket.AF_UNIX)
        await asyncio.get_running_loop().run_in_executor(None, stuck.connect, str(path))
        await until(lambda: run.audience.is_controlled)
        while run.audience.is_controlled:
            run.audience.send(BULKY)
            await asyncio.sleep(0)
        assert [await run.calls.get() for _ in range(2)] == ["control", "lost"]
        stuck.close()
        other = await run.client()
        await other.until_control(is_in_control=True)


async def test_what_waits_is_told_before_the_end(scripted_run) -> None:
    async with scripted_run() as run:
        client = await run.client()
        await client.until_control(is_in_control=True)
        for _ in range(100):
            run.audience.send(BULKY)
        ending = asyncio.ensure_future(run.audience.dismiss())
        assert (await client.until_over()).count(BULKY) == 100
        await ending


async def test_another_users_run_is_refused(scripted_run, path, monkeypatch) -> None:
    async with scripted_run() as run:
        monkeypatch.setattr("hexacell.run_process.client.peer_of", lambda _: (1, 12345))
        with pytest.raises(FileError, match="is another user's"):
            await connect_to_run(path)
        assert [await run.calls.get() for _ in range(2)] == ["control", "lost"]


async def test_another_user_is_told_nothing(scripted_run, monkeypatch) -> None:
    async with scripted_run() as run:
        monkeypatch.setattr("hexacell.run_process.audience.peer_of", lambda _: (1, 12345))
        stranger = await run.client()
        assert await stranger.until_over() == [LOST]
        assert not run.audience.is_controlled


async def test_a_run_that_is_gone_is_told_so(scripted_run) -> None:
    async with scripted_run() as run:
        client = await run.client()
        await client.until_control(is_in_control=True)
    await client.until_over()
    with pytest.raises(FileError, match="cannot be reached any more"):
        await client.connection.give(Undo())


SOME_TURNS = 20
"""Turns of the loop in which a client that does not wait would be gone."""


async def everything(connection: HostConnection) -> list[HostMessage]:
    return [message async for message in connection.messages()]


async def test_a_client_stays_until_the_run_has_heard_that_it_is_to_go_on(tmp_path) -> None:
    heard: asyncio.Queue[ClientMessage] = asyncio.Queue()
    may_hang_up = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        heard.put_nowait(client_message(await reader.readline()))
        await may_hang_up.wait()
        writer.write(message_line(StatusChanged(status=Status.RUNNING)))  # it was on its way
        writer.close()

    async with await asyncio.start_unix_server(serve, str(tmp_path / "s")):
        connection = HostConnection(*await asyncio.open_unix_connection(str(tmp_path / "s")))
        told = asyncio.ensure_future(everything(connection))
        leaving = asyncio.ensure_future(connection.leave(keep_running=True))
        assert await heard.get() == Leave(keep_running=True)
        for _ in range(SOME_TURNS):
            await asyncio.sleep(0)
        assert not leaving.done()
        may_hang_up.set()
        await leaving
        assert await told == [], "who has left is told nothing more"
