"""Headless Chromium in tests, told over its DevTools protocol what to open and to press."""

import asyncio
import base64
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse

from tests.waiting import until

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
_CONTROL = re.compile(r"\x1b\[[0-9;?<>=$]*[a-zA-Z]")


class Tab:
    """A page that is open: what it loaded, said and drew."""

    def __init__(
        self, address: str, number: str, client: ClientSession, line: ClientWebSocketResponse
    ) -> None:
        self._address, self._number, self._client, self._line = address, number, client, line
        self._calls = 0
        self.loaded: list[str] = []
        self.problems: list[str] = []
        self.drawn = ""

    async def call(self, method: str, **parameters: object) -> Any:
        self._calls += 1
        await self._line.send_json({"id": self._calls, "method": method, "params": parameters})
        while (answer := await self._hear()).get("id") != self._calls:
            pass
        return answer["result"]

    async def _hear(self) -> dict[str, Any]:
        message: dict[str, Any] = await self._line.receive_json()
        match message:
            case {"method": "Network.requestWillBeSent", "params": {"request": {"url": url}}}:
                self.loaded.append(url)
            case {"method": "Network.webSocketFrameReceived", "params": {"response": frame}}:
                if frame["opcode"] == 2:
                    self.drawn += _CONTROL.sub("", base64.b64decode(frame["payloadData"]).decode())
            case {"method": "Log.entryAdded", "params": {"entry": {"level": "error", "text": text}}}:
                self.problems.append(text)
        return message

    async def wait_for(self, words: str) -> None:
        """Wait until a terminal in it was sent these words."""
        while words not in self.drawn:
            await self._hear()

    async def wait_for_element(self, selector: str) -> None:
        """Wait until there is such a one in it."""
        found = f"document.querySelector({selector!r}) !== null"
        while not (await self.call("Runtime.evaluate", expression=found))["result"]["value"]:
            await (
                self._hear()
            )  # a browser tells of what goes on in a page, as of a websocket that was closed

    async def press(self, key: str) -> None:
        self.drawn = ""
        await self.call("Input.dispatchKeyEvent", type="keyDown", text=key, key=key)
        await self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    async def close(self) -> None:
        await self._line.close()
        await self._client.get(f"http://{self._address}/json/close/{self._number}")


class Browser:
    """A browser in which pages can be opened."""

    def __init__(self, address: str, client: ClientSession) -> None:
        self._address, self._client = address, client

    async def open(self, url: str) -> Tab:
        answer = await self._client.put(f"http://{self._address}/json/new?about:blank")
        made = await answer.json()
        line = await self._client.ws_connect(made["webSocketDebuggerUrl"], max_msg_size=0)
        tab = Tab(self._address, made["id"], self._client, line)
        for domain in ("Network", "Page", "Log"):
            await tab.call(f"{domain}.enable")
        await tab.call("Emulation.setFocusEmulationEnabled", enabled=True)
        await tab.call("Page.navigate", url=url)
        return tab


@asynccontextmanager
async def opened_browser(folder: Path) -> AsyncIterator[Browser]:
    """A browser with its files in ``folder``, until the end of this context."""
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--window-size=1200,800")
    command = [str(CHROMIUM), *options, "--remote-debugging-port=0", f"--user-data-dir={folder}"]
    process = await asyncio.create_subprocess_exec(*command, stderr=subprocess.DEVNULL)
    try:
        told = folder / "DevToolsActivePort"
        await until(lambda: told.exists() and told.read_text().count("\n") > 0)
        async with ClientSession() as client:
            yield Browser(f"127.0.0.1:{told.read_text().split()[0]}", client)
    finally:
        process.terminate()
        await process.wait()
