"""How a client leaves: not before the run has heard it."""

import asyncio

from hexacell.run_process.client import HostConnection
from hexacell.run_process.messages import (
    ClientMessage,
    HostMessage,
    Leave,
    StatusChanged,
    client_message,
    message_line,
)
from procedures.engine.command_loop import Status

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
