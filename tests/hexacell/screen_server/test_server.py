"""Nobody but its user, or who knows the password, reaches the screen in a browser; no other page does."""

import base64
import os
import re
import signal
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from aiohttp import ClientSession, WSServerHandshakeError
from aiohttp.test_utils import TestServer

from hexacell.cell.passwords import Login
from hexacell.errors import DeviceError, UsageError
from hexacell.screen_server import access
from hexacell.screen_server import server as server_module
from hexacell.screen_server.access import Access
from hexacell.screen_server.server import ScreenServer, serve_screen
from tests.waiting import until

LOGIN = Login("tester-7", "hidden-pässword")
PATHS = ("/", "/static/js/textual.js", "/ws/{ticket}", "/ws/guessed", "/download/key", "/nothing")


def basic(words: str) -> str:
    return f"Basic {base64.b64encode(words.encode()).decode()}"


KNOWN = basic("tester-7:hidden-pässword")
# In place of the screen, which takes seconds to load: it has a child, and hears nothing.
SCREEN = """
import subprocess, sys
child = subprocess.Popen(["sleep", "infinity"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
open(sys.argv[1], "w").write(f"{child.pid} ")
print("__GANGLION__", flush=True)
sys.stdout.buffer.write(b"D" + (5).to_bytes(4, "big") + b"drawn")
sys.stdout.flush()
child.wait()
"""


class Served:
    """A server within this process, and a client that connects to it."""

    def __init__(self, screen: ScreenServer, server: TestServer, client: ClientSession) -> None:
        self.screen, self.server, self._client = screen, server, client
        self.origin = f"http://127.0.0.1:{server.port}"

    async def status(self, path: str, **headers: str) -> int:
        answer = await self._client.get(self._address(path), headers=headers)
        if answer.status != 200:
            assert answer.headers["Content-Type"].startswith("text/plain")
            assert self.screen._ticket not in await answer.text()
        return answer.status

    def websocket(self, path: str = "/ws/{ticket}", **headers: str):
        return self._client.ws_connect(self._address(path), headers={"Origin": self.origin} | headers)

    async def page(self) -> tuple[str, str]:
        """Its text, and what it may load."""
        answer = await self._client.get(self._address("/"))
        return await answer.text(), answer.headers["Content-Security-Policy"]

    def _address(self, path: str) -> str:
        return self.origin + path.format(ticket=self.screen._ticket)


@pytest.fixture
def serving(tmp_path: Path):
    @asynccontextmanager
    async def serve(login: Login | None = None) -> AsyncIterator[Served]:
        screen = ScreenServer(tmp_path / "cell.toml", Access(frozenset({"localhost"}), login))
        screen.command = "\0".join([sys.executable, "-c", SCREEN, str(tmp_path / "child")])
        server = TestServer(screen.application())
        async with server, ClientSession() as client:
            yield Served(screen, server, client)

    return serve


@pytest.mark.parametrize(
    "host",
    ["evil.example", "127.0.0.1.evil.example", "me@127.0.0.1", "localhost:1:2", "robot-pc", "[::g]", ""],
)
async def test_no_name_that_leads_here_by_somebodys_will_is_served(serving, host: str) -> None:
    async with serving() as served:
        named = {"Host": host, "Origin": f"http://{host}"}
        assert {await served.status(path, **named) for path in PATHS} == {403}
        with pytest.raises(WSServerHandshakeError, match="403"):
            await served.websocket(**named)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:1", "https://127.0.0.1", "null", ""]
)
async def test_no_other_page_reaches_it(serving, origin: str) -> None:
    async with serving() as served:
        assert {await served.status(path, Origin=origin) for path in PATHS} == {403}
        with pytest.raises(WSServerHandshakeError, match="403"):
            await served.websocket(Origin=origin)
        assert await served.status("/ws/{ticket}", Upgrade="websocket") == 403, "no page is named"


async def test_a_page_that_was_not_served_has_no_websocket(serving) -> None:
    async with serving() as served:
        with pytest.raises(WSServerHandshakeError, match="403"):
            await served.websocket("/ws/guessed")


async def test_without_a_password_it_is_for_its_user_alone(serving, monkeypatch) -> None:
    async with serving() as served:
        assert await served.status("/") == 200
        assert await served.status("/", Host="localhost:9999", Origin="http://localhost:9999") == 200, (
            "a tunnel"
        )
        user = os.getuid()
        monkeypatch.setattr(os, "getuid", lambda: user + 1)
        assert {await served.status(path) for path in ("/", "/ws/guessed", "/static/js/textual.js")} == {
            403
        }
        monkeypatch.setattr(os, "getuid", lambda: user)
        monkeypatch.setattr(access, "kernel_connections", tuple)
        assert await served.status("/") == 403, "who it is cannot be told"


@pytest.mark.parametrize(
    "given",
    [
        "",
        basic("tester-7:guessed"),
        basic("other:hidden-pässword"),
        basic("tester-7"),
        "Basic !",
        KNOWN.replace("Basic", "Bearer"),
    ],
)
async def test_without_the_password_nothing_is_served(serving, given: str) -> None:
    async with serving(LOGIN) as served:
        paths = [path for path in PATHS if path != "/ws/{ticket}"]
        assert {await served.status(path, Authorization=given) for path in paths} == {401}
        with pytest.raises(WSServerHandshakeError, match="401"):
            await served.websocket("/ws/guessed", Authorization=given)
        assert await served.status("/", Authorization=KNOWN) == 200


async def test_the_page_needs_no_other_server_and_lies_in_no_other_page(serving) -> None:
    async with serving() as served:
        text, policy = await served.page()
    assert re.findall(r"\w+://[^\s\"]*", text) == [f"ws://{served.origin[7:]}/ws/{served.screen._ticket}"]
    assert {"default-src 'none'", "frame-ancestors 'none'"} <= set(policy.split("; "))


def status_of(process: str | int) -> dict[str, str]:
    """What the kernel says of it; nothing of one that is over."""
    with suppress(OSError):
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        found = dict(line.split(":\t", 1) for line in lines)
        return {} if found["State"].startswith("Z") else found
    return {}


@pytest.mark.parametrize("ends", ["page", "process", "server", "stopped process"])
async def test_a_page_and_its_process_end_together(serving, tmp_path: Path, ends: str) -> None:
    child = tmp_path / "child"
    async with serving(LOGIN) as served:
        websocket = await served.websocket()  # of a browser that sends no password with it
        assert await websocket.receive_bytes() == b"drawn"
        started = child.read_text().strip()
        parent = int(status_of(started)["PPid"])
        if ends == "server":
            await served.server.close()
        elif ends == "process":
            os.kill(parent, signal.SIGTERM)
            assert (await websocket.receive()).type.name in {"CLOSE", "CLOSING", "CLOSED"}
        else:
            if ends == "stopped process":
                os.kill(parent, signal.SIGSTOP)
            await websocket.close()
        await until(lambda: not (status_of(started) or status_of(parent)))


async def test_there_are_not_more_pages_than_a_computer_can_bear(serving, monkeypatch) -> None:
    monkeypatch.setattr(server_module, "MOST_PAGES", 1)
    async with serving() as served:
        first = await served.websocket()
        with pytest.raises(WSServerHandshakeError, match="503"):
            await served.websocket()
        await first.close()


@pytest.mark.parametrize("place", ["0.0.0.0:8000", "192.0.2.1", "[::]:8000"])
async def test_other_computers_need_a_password(place: str) -> None:
    with pytest.raises(UsageError, match="could move the robot"):
        await serve_screen(place, Path("cell.toml"), None, print, print)


@pytest.mark.parametrize(
    "place", ["cell.toml/", "me@127.0.0.1:8000", "127.0.0.1:x", ":8000", "127.0.0.1:0"]
)
async def test_what_is_no_place_is_refused(place: str) -> None:
    with pytest.raises(UsageError, match=r"is no (place|address)"):
        await serve_screen(place, Path("cell.toml"), LOGIN, print, print)


async def test_a_port_that_is_taken_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(DeviceError, match=f"{place}: cannot be served"):
            await serve_screen(place, Path("cell.toml"), None, print, print)
