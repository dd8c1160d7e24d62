"""The server of a cell's results by OPC UA: those there are when it begins, then an event for each new one.

Names, meanings and values are those of OPC 40001-101 (Machinery, Result Transfer), 1.00: ResultManagement
with its Results, ResultMetaData, ResultReadyEventType. They are in a namespace of their own, because the
types of that specification, its structured data types and its methods among them, are not all here.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Self

from asyncua import ua
from asyncua.common.node import Node
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.event_generator import EventGenerator
from asyncua.server.server import Server

from hexacell.cell.loader import Cell
from hexacell.cell.operation import OpcUaSettings
from hexacell.cell.passwords import Login, stated_login
from hexacell.errors import DeviceError, UsageError
from hexacell.result_server.published_result import SEVERITIES, NewResults, PublishedResult
from hexacell.storage.opcua_certificate import ensure_certificate

URI = "urn:hexacell:result-server"
NAMESPACE = "urn:hexacell:results"
MOST_RESULTS = 10
"""Results of a cell in the address space; older ones are in its run folders."""

FIELDS = (
    ("ResultId", ua.VariantType.String),
    ("IsSimulated", ua.VariantType.Boolean),
    ("ResultState", ua.VariantType.Int32),
    ("CreationTime", ua.VariantType.DateTime),
    ("ResultEvaluation", ua.VariantType.Int32),
    ("ResultEvaluationDetails", ua.VariantType.String),
    ("Mode", ua.VariantType.String),
    ("Verdict", ua.VariantType.String),
    ("PositionErrorMm", ua.VariantType.Double),
    ("ExpandedUncertaintyMm", ua.VariantType.Double),
    ("LimitMm", ua.VariantType.Double),
)
META_DATA = 6
"""The first fields are those of ResultMetaData, the others those of ResultContent."""

VARIABLES = {"user": "HEXACELL_OPCUA_USER", "password": "HEXACELL_OPCUA_PASSWORD"}
LOGIN_S = 5.0
"""So long a connection may last without a login; asyncua keeps all that is sent on it."""


@dataclass(frozen=True, slots=True)
class Reader:
    """Who may read; anybody without a login."""

    login: Login | None = None

    def get_user(
        self,
        _iserver: Any,  # noqa: ANN401 - as asyncua calls it
        username: str | None = None,
        password: str | bytes | None = None,
        certificate: object = None,  # noqa: ARG002 - likewise
    ) -> User | None:
        """Whoever logs in, who can change nothing; None if refused, as slowly for any wrong password."""
        given = password.decode(errors="replace") if isinstance(password, bytes) else password or ""
        is_reader = self.login.admits(username or "", given) if self.login else username is None
        return User(role=UserRole.User) if is_reader else None


def allowed_reader(settings: OpcUaSettings, folder: Path) -> Reader:
    """Who may read; ``folder`` has the cell file.

    Raises:
        FileError: the password file cannot be read, or others can read or change it.
        UsageError: nobody is named, and the cell file does not let anybody in; or a variable is too long.
    """
    login = stated_login(settings.password_file, folder, VARIABLES)
    if login or settings.anonymous:
        return Reader(login)
    raise UsageError(
        "nobody may read the results",
        subject="[opcua]",
        action=f"Name a password_file, or set {' and '.join(VARIABLES.values())}",
    )


class ResultNodes:
    """The results of one cell in the address space of a server."""

    def __init__(self, namespace: int, results: Node, event: EventGenerator) -> None:
        self._namespace, self._results, self._event = namespace, results, event
        self._shown: deque[Node] = deque()

    @classmethod
    async def of(cls, server: Server, cell: str) -> Self:
        """Make the nodes of a cell: Objects / its name / ResultManagement / Results."""
        namespace = await server.register_namespace(NAMESPACE)
        event_type = await server.create_custom_event_type(
            namespace, "ResultReadyEventType", properties=list(FIELDS)
        )
        of_cell = await server.nodes.objects.add_object(namespace, cell)
        management = await of_cell.add_object(namespace, "ResultManagement")
        results = await management.add_folder(namespace, "Results")
        event = await server.get_event_generator(event_type, emitting_node=management.nodeid)
        return cls(namespace, results, event)

    async def show(self, result: PublishedResult) -> None:
        """Add a result as the newest; the oldest goes where there are too many."""
        node = await self._results.add_object(self._namespace, result.result_id)
        meta = await node.add_object(self._namespace, "ResultMetaData")
        content = await node.add_object(self._namespace, "ResultContent")
        for number, ((name, kind), value) in enumerate(zip(FIELDS, astuple(result), strict=True)):
            parent = meta if number < META_DATA else content
            await parent.add_variable(self._namespace, name, value, varianttype=kind)
        self._shown.append(node)
        while len(self._shown) > MOST_RESULTS:
            oldest = ua.DeleteNodesItem(self._shown.popleft().nodeid, DeleteTargetReferences=True)
            await self._event.isession.delete_nodes(ua.DeleteNodesParameters([oldest]))

    async def notify(self, result: PublishedResult) -> None:
        """Raise the event of a result that is ready."""
        event = self._event.event
        event.Severity = SEVERITIES[result.evaluation]
        for (name, _), value in zip(FIELDS, astuple(result), strict=True):
            setattr(event, name, value)
        await self._event.trigger(message=result.details)


async def serve_results(
    cell: Cell, settings: OpcUaSettings, ready: Callable[[str], None], warn: Callable[[str], None]
) -> None:
    """Serve until cancelled; ``ready`` gets the address, ``warn`` the reason why runs cannot be read.

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
        results = NewResults(cell, warn)
        for result in (await asyncio.to_thread(results.fetch))[-MOST_RESULTS:]:
            await nodes.show(result)
        ready(server.endpoint.geturl())
        while True:  # what is new comes with an event
            await asyncio.sleep(settings.poll_s)
            for result in await asyncio.to_thread(results.fetch):
                await nodes.show(result)
                await nodes.notify(result)
    finally:
        await server.stop()


async def _server(settings: OpcUaSettings, reader: Reader, folder: Path) -> Server:
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it reports each refused client at length
    certificate, key = ensure_certificate(folder, URI, settings.host)
    server = Server(user_manager=reader)  # type: ignore[arg-type]  # it needs the one method
    await server.init()
    server.iserver.max_pending_activation_seconds = LOGIN_S
    server.set_endpoint(f"opc.tcp://{settings.host}:{settings.port}/hexacell/")
    server.set_server_name("hexacell results")
    await server.set_application_uri(URI)
    server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    server.set_identity_tokens([ua.UserNameIdentityToken if reader.login else ua.AnonymousIdentityToken])
    await server.load_certificate(certificate)
    await server.load_private_key(key)
    return server
