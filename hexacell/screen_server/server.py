"""The server of the screen: a page, and for each browser that shows it a process of this program."""

import asyncio
import hmac
import os
import secrets
import signal
import socket
from asyncio.subprocess import PIPE, Process
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

from aiohttp import WSCloseCode, web
from jinja2 import Template
from textual_serve.app_service import AppService
from textual_serve.server import Server, to_int

from hexacell.addresses import address_of
from hexacell.cell.passwords import Login
from hexacell.errors import DeviceError, UsageError
from hexacell.python_process import python_command
from hexacell.screen_server.access import Access
from hexacell.services.preflight import is_loopback
from hexacell.storage import atomic_files
from procedures.run.cancellation import cancel_and_wait, shielded

DEFAULT_PORT = 8000
MOST_PAGES = 10
HEARTBEAT_S = 5.0
"""A browser that says nothing for half as long after so long a time is gone, and its process ends."""
CLOSING_S = 2.0

PAGE = Template(atomic_files.read_text(Path(__file__).with_name("page.html")), autoescape=True)
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self' "
    "'unsafe-inline'; font-src 'self'; img-src data:; connect-src 'self' ws://{host}; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class PageProcess(AppService):
    """The process of one page, which ends with the page, and with this process: its input ends then."""

    async def _open_app_process(self, width: int = 80, height: int = 24) -> Process:
        self._process = await asyncio.create_subprocess_exec(
            *self.command.split("\0"),
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            env=self._build_environment(width, height),
            start_new_session=True,  # so that it ends with those that it has started
        )
        self._stdin = self._process.stdin
        return self._process

    async def run(self) -> None:
        """Pass on what it draws, and close the page after that: a picture that stays would be believed."""
        await super().run()
        await self.remote_close()

    async def stop(self) -> None:
        """End it at once, as where a terminal is gone."""
        if (task := self._task) is None or self._process is None:
            return
        self._task = None
        await self._download_manager.cancel_app_downloads(app_service_id=self.app_service_id)
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        await cancel_and_wait(task)
        await self._process.wait()


class ScreenServer(Server):
    """The page of a cell's screen, its scripts and fonts, and the websockets of browsers that show it."""

    def __init__(self, cell: Path, access: Access) -> None:
        super().__init__("\0".join(python_command("hexacell", "page", "--", str(cell))), title=cell.stem)
        self._access, self._ticket = access, secrets.token_urlsafe()
        self._pages: dict[web.WebSocketResponse, asyncio.Task[object] | None] = {}

    def application(self) -> web.Application:
        """All that is served; nothing of it to whom ``access`` refuses."""
        app = web.Application(middlewares=[self._admit])
        app.router.add_get("/", self.handle_index)
        app.router.add_get("/ws/{ticket}", self.handle_websocket)
        app.router.add_get("/download/{key}", self.handle_download)
        app.router.add_static("/static", self.statics_path)
        app.on_shutdown.append(self._close_pages)
        return app

    @web.middleware
    async def _admit(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        self._access.require_own_page(request)
        # Not every browser sends a password with a websocket: its page, which had one, has a ticket.
        if not hmac.compare_digest(request.match_info.get("ticket", "").encode(), self._ticket.encode()):
            self._access.require_known_person(request)
            if "ticket" in request.match_info:
                raise web.HTTPForbidden(text="This is of a page that was served earlier.")
        return await handler(request)

    async def handle_index(self, request: web.Request) -> web.Response:
        """The page; its websocket leads to where the browser found it."""
        nonce = secrets.token_urlsafe()
        text = PAGE.render(
            title=self.title, websocket=f"ws://{request.host}/ws/{self._ticket}", nonce=nonce
        )
        headers = {name: value.format(nonce=nonce, host=request.host) for name, value in HEADERS.items()}
        return web.Response(text=text, content_type="text/html", headers=headers)

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """A process of the screen until either side closes."""
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text=f"{MOST_PAGES} pages show this screen already.")
        websocket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, timeout=CLOSING_S)
        self._pages[websocket] = asyncio.current_task()
        try:
            await websocket.prepare(request)
            process = PageProcess(
                self.command,
                write_bytes=websocket.send_bytes,
                write_str=websocket.send_str,
                close=websocket.close,  # type: ignore[arg-type]  # what it returns is not used
                download_manager=self.download_manager,
            )
            width, height = (to_int(request.query.get(name, ""), 80) for name in ("width", "height"))
            try:
                # A process that was just being started when the server ended would be nobody's.
                await shielded(process.start(width, height))
                await self._process_messages(websocket, process)
            finally:
                await shielded(process.stop())
        finally:
            del self._pages[websocket]
        return websocket

    async def _close_pages(self, _: web.Application) -> None:
        tasks = [task for task in self._pages.values() if task is not None]
        closing = [page.close(code=WSCloseCode.GOING_AWAY) for page in self._pages]
        await asyncio.gather(*closing, *tasks, return_exceptions=True)


async def serve_screen(
    place: str, cell: Path, login: Login | None, ready: Callable[[str], None], warn: Callable[[str], None]
) -> None:
    """Serve until cancelled; the cell file need not be there yet.

    Args:
        place: address or name of this computer, and port.
        cell: the cell file.
        login: who may use the screen; without one, processes of this user on this computer alone.
        ready: gets a line with the page's address.
        warn: gets what somebody should know who lets others reach it.

    Raises:
        UsageError: the place is none, or others reach it and there is no login.
        DeviceError: the port is taken, or is no port of this computer.
    """
    named, port = _place(place)
    try:
        found = await asyncio.get_running_loop().getaddrinfo(named, port, type=socket.SOCK_STREAM)
        hosts = list(dict.fromkeys(str(one[4][0]) for one in found))
        is_local = all(map(is_loopback, hosts))
        if login is None and not is_local:
            raise UsageError(
                f"whoever reaches {named} could move the robot",
                subject="[screen]",
                action="Name a password_file, set HEXACELL_SCREEN_USER and HEXACELL_SCREEN_PASSWORD, "
                "or serve 127.0.0.1",
            )
        names = {"localhost", named} | (set() if is_local else {socket.gethostname().lower()})
        server = ScreenServer(cell, Access(frozenset(names), login))
        runner = web.AppRunner(server.application(), access_log=None, shutdown_timeout=5.0)
        await runner.setup()
        try:
            for host in hosts:
                await web.TCPSite(runner, host, port).start()
            if not is_local:
                warn(
                    f"who reaches {place} with the password can move the robot, and nothing is encrypted. "
                    "In a network of others serve 127.0.0.1, and reach it by `ssh -L`"
                )
            ready(f"serving http://{place}/")
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()
    except OSError as error:
        raise DeviceError(
            f"cannot be served: {error.strerror or error}",
            subject=place,
            action="Name an address of this computer and a free port",
        ) from error


def _place(text: str) -> tuple[str, int]:
    address = address_of(f"http://{text}")
    if "@" in text or not address.hostname or address.netloc != text:
        raise UsageError(f"'{text}' is no place to serve at", action="Write it as ADDRESS:PORT")
    return address.hostname, address.port or DEFAULT_PORT
