"""The server: results that are there when it begins, then an event for each new one."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from asyncua import ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.server import Server

from hexacell.cell.loader import Cell
from hexacell.cell.operation import OpcUaSettings
from hexacell.errors import DeviceError
from hexacell.result_server.address_space import MOST_RESULTS, ResultNodes
from hexacell.result_server.credentials import Reader, allowed_reader, ensure_certificate
from hexacell.result_server.published_result import NewResults

URI = "urn:hexacell:result-server"


class _Readers:
    """Lets the reader in, who can change nothing."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader

    def get_user(
        self,
        _iserver: Any,  # noqa: ANN401 - as asyncua calls it
        username: str | None = None,
        password: str | bytes | None = None,
        certificate: object = None,  # noqa: ARG002 - likewise
    ) -> User | None:
        """The user; None for whoever is refused."""
        text = password.decode("utf-8", "replace") if isinstance(password, bytes) else password
        return User(role=UserRole.User) if self._reader.is_this(username, text) else None


async def serve_results(
    cell: Cell,
    settings: OpcUaSettings,
    stop: asyncio.Event,
    ready: Callable[[str], None],
    warn: Callable[[str], None],
) -> None:
    """Serve until ``stop`` is set; ``ready`` gets the address, ``warn`` the reason why runs cannot be read.

    Raises:
        FileError: its certificate cannot be read or made.
        UsageError: nobody may read.
        DeviceError: the port is taken, or is no port of this computer.
    """
    reader = allowed_reader(settings, cell.path.parent)
    server = await _server(settings, reader, cell.path.parent / settings.folder)
    nodes = await ResultNodes.of(server, cell.settings.name)
    try:
        await server.start()
    except OSError as error:
        raise DeviceError(
            f"cannot be served: {error.strerror or error}",
            subject=server.endpoint.geturl(),
            action="Correct host and port in [opcua]",
        ) from error
    try:
        await _follow(cell, settings, nodes, stop, ready=lambda: ready(server.endpoint.geturl()), warn=warn)
    finally:
        await server.stop()


async def _server(settings: OpcUaSettings, reader: Reader, folder: Path) -> Server:
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it reports each refused client at length
    certificate, key = ensure_certificate(folder, URI, settings.host)
    server = Server(user_manager=_Readers(reader))  # type: ignore[arg-type]  # it needs the one method
    await server.init()
    server.set_endpoint(f"opc.tcp://{settings.host}:{settings.port}/hexacell/")
    server.set_server_name("hexacell results")
    await server.set_application_uri(URI)
    server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    server.set_identity_tokens([ua.UserNameIdentityToken if reader.user else ua.AnonymousIdentityToken])
    await server.load_certificate(certificate)
    await server.load_private_key(key)
    return server


async def _follow(
    cell: Cell,
    settings: OpcUaSettings,
    nodes: ResultNodes,
    stop: asyncio.Event,
    *,
    ready: Callable[[], None],
    warn: Callable[[str], None],
) -> None:
    """Show what there is, then show what is new with an event."""
    results = NewResults(cell, warn)
    for result in (await asyncio.to_thread(results.fetch))[-MOST_RESULTS:]:
        await nodes.show(result)
    ready()
    while not stop.is_set():
        with suppress(TimeoutError):
            await asyncio.wait_for(stop.wait(), settings.poll_s)
            return
        for result in await asyncio.to_thread(results.fetch):
            await nodes.show(result)
            await nodes.notify(result)
