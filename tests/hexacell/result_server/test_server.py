"""Results by OPC UA reach who may read them, as asyncua's own client sees it, and nobody else."""

import asyncio
import logging
import math
import socket
import stat
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from asyncua import ua
from asyncua.client.client import Client
from asyncua.crypto import cert_gen
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.ua.uaerrors import UaError
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

from hexacell.cell.loader import Cell
from hexacell.cell.operation import OpcUaSettings
from hexacell.cell.passwords import Login
from hexacell.errors import DeviceError, FileError, UsageError
from hexacell.result_server import server
from hexacell.result_server import server as server_module
from hexacell.runs.run_folder import runs_folder
from hexacell.storage.opcua_certificate import ensure_certificate
from hexacell.verdict.decision import Verdict
from procedures.run.cancellation import cancel_and_wait
from tests.hexacell.services.notify.local_servers import closed_port
from tests.hexacell.services.proposed_runs import a_cell, propose_run

USER, PASSWORD = "line-7", "hidden-password"
READER_FILE = "reader.toml"
QUIET = logging.getLogger("asyncua")


@pytest.fixture(autouse=True)
def quiet():
    """The library's words about refused clients are not of the tests."""
    level = QUIET.level
    yield
    QUIET.setLevel(level)


@pytest.fixture
def cell(tmp_path, monkeypatch) -> Cell:
    monkeypatch.setenv("HEXACELL_OPCUA_USER", USER)
    monkeypatch.setenv("HEXACELL_OPCUA_PASSWORD", PASSWORD)
    return a_cell(tmp_path)


@pytest.fixture(scope="module")
def client_files(tmp_path_factory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("client")
    key = cert_gen.generate_private_key()
    names = [x509.UniformResourceIdentifier("urn:test:client"), x509.DNSName("localhost")]
    made = cert_gen.generate_self_signed_app_certificate(
        key, "test", {}, names, extended=[ExtendedKeyUsageOID.CLIENT_AUTH]
    )
    (folder / "certificate.der").write_bytes(made.public_bytes(Encoding.DER))
    (folder / "key.pem").write_bytes(cert_gen.dump_private_key_as_pem(key))
    return folder / "certificate.der", folder / "key.pem"


@asynccontextmanager
async def serving(
    cell: Cell, warn: Callable[[str], None] = lambda _: None, **further: Any
) -> AsyncIterator[str]:
    """The address of a server that runs."""
    settings = OpcUaSettings(port=closed_port(), poll_s=0.05, **further)
    address = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(server.serve_results(cell, settings, address.set_result, warn))
    await asyncio.wait({task, address}, return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        task.result()
    try:
        yield address.result()
    finally:
        await cancel_and_wait(task)


@asynccontextmanager
async def reading(
    address: str, files: tuple[Path, Path], user: str | None = USER, password: str = PASSWORD
) -> AsyncIterator[Client]:
    client = Client(address)
    client.application_uri = "urn:test:client"
    await client.set_security(SecurityPolicyBasic256Sha256, files[0], files[1])
    if user is not None:
        client.set_user(user)
        client.set_password(password)
    async with client:
        yield client


async def results(client: Client, cell: Cell) -> dict[str, dict[str, Any]]:
    """All results by their names, with the values of all their variables."""
    number = await client.get_namespace_index(server.NAMESPACE)
    path = [f"{number}:{name}" for name in (cell.settings.name, "ResultManagement", "Results")]
    folder = await client.nodes.objects.get_child(path)
    found: dict[str, dict[str, Any]] = {}
    for node in await folder.get_children():
        name = (await node.read_browse_name()).Name
        found[name] = {}
        for part in await node.get_children():
            for variable in await part.get_children():
                found[name][(await variable.read_browse_name()).Name] = await variable.read_value()
    return found


def password_file(cell: Cell, mode: int) -> None:
    path = cell.path.parent / READER_FILE
    path.write_text(f'user = "{USER}"\npassword = "{PASSWORD}"\n')
    path.chmod(mode)


class Heard:
    """What a subscription is told."""

    def __init__(self) -> None:
        self.told: asyncio.Queue[Any] = asyncio.Queue()

    def event_notification(self, event: Any) -> None:
        self.told.put_nowait(event)


async def test_the_reader_alone_gets_in_reads_results_changes_none_and_is_told_each_new_one_once(
    cell, client_files, monkeypatch
) -> None:
    monkeypatch.delenv("HEXACELL_OPCUA_USER")
    password_file(cell, 0o600)
    propose_run(cell, "2026-11-01T100000Z")
    going_on = propose_run(cell, "2026-11-01T110000Z").folder.journal
    going_on.write_bytes(b"".join(going_on.read_bytes().splitlines(keepends=True)[:-1]))
    name = cell.settings.name
    async with (
        serving(cell, password_file=READER_FILE) as address,
        reading(address, client_files) as client,
    ):
        await _only_the_reader_gets_in(address, client_files)
        ((shown, values),) = (await results(client, cell)).items()
        assert shown == values["ResultId"] == f"{name}/2026-11-01T100000Z"
        assert (values["ResultEvaluation"], values["ResultState"], values["IsSimulated"]) == (1, 1, True)
        assert (values["Verdict"], values["Mode"]) == ("pass", "optimise")
        assert values["ResultEvaluationDetails"] == "over"
        assert math.isnan(values["PositionErrorMm"])
        await _changes_nothing(client, cell, "2026-11-01T100000Z")

        number = await client.get_namespace_index(server.NAMESPACE)
        kind = await client.nodes.base_event_type.get_child(f"{number}:ResultReadyEventType")
        management = await client.nodes.objects.get_child(
            [f"{number}:{name}", f"{number}:ResultManagement"]
        )
        heard = Heard()
        subscription = await client.create_subscription(20, heard)
        await subscription.subscribe_events(management, kind)
        days = range(2, server.MOST_RESULTS + 3)
        verdicts = [Verdict.FAIL, Verdict.CONDITIONAL_PASS, None, *[Verdict.PASS] * server.MOST_RESULTS]
        expected = [(2, 800), (3, 500), (0, 500), *[(1, 100)] * server.MOST_RESULTS]
        for day, verdict, (evaluation, severity) in zip(days, verdicts, expected, strict=False):
            propose_run(cell, f"2026-11-{day:02}T100000Z", verdict=verdict)
            event = await heard.told.get()
            assert event.ResultId == f"{name}/2026-11-{day:02}T100000Z"
            assert (event.ResultEvaluation, event.Severity) == (evaluation, severity)
            assert event.Message.Text == "over"
        assert heard.told.empty()
        left = sorted(await results(client, cell))
    assert left == [f"{name}/2026-11-{day:02}T100000Z" for day in days][-server.MOST_RESULTS :]


async def _only_the_reader_gets_in(address: str, client_files: tuple[Path, Path]) -> None:
    strangers = [(USER, "wrong"), ("other", PASSWORD), (USER, ""), (None, ""), ("admin", "")]
    for user, password in strangers:
        with pytest.raises(UaError):
            async with reading(address, client_files, user, password):
                pass
    endpoints = await Client(address).connect_and_get_server_endpoints()
    assert {(one.SecurityMode, one.SecurityPolicyUri) for one in endpoints} == {
        (ua.MessageSecurityMode.SignAndEncrypt, SecurityPolicyBasic256Sha256.URI)
    }
    plain = Client(address)
    plain.set_user(USER)
    plain.set_password(PASSWORD)
    with pytest.raises(UaError):
        await plain.connect()


async def _changes_nothing(client: Client, cell: Cell, run: str) -> None:
    number = await client.get_namespace_index(server.NAMESPACE)
    name = cell.settings.name
    path = (name, "ResultManagement", "Results", f"{name}/{run}")
    node = await client.nodes.objects.get_child([f"{number}:{one}" for one in path])
    (meta, _) = await node.get_children()
    (variable, *_) = await meta.get_children()
    for change in (variable.write_value("another"), node.delete(), node.add_folder(number, "mine")):
        with pytest.raises(UaError):
            await change
    assert (await results(client, cell))[path[-1]]["ResultId"] == path[-1]


async def test_who_has_not_logged_in_reads_nothing_and_is_let_go(cell, client_files, monkeypatch) -> None:
    monkeypatch.setattr(server_module, "LOGIN_S", 0.2)
    async with serving(cell) as address:
        port = int(address.split(":")[2].split("/")[0])
        client = Client(address)
        client.application_uri = "urn:test:client"
        await client.set_security(SecurityPolicyBasic256Sha256, *client_files)
        await client.connect_socket()
        await client.send_hello()
        await client.open_secure_channel()
        await client.create_session()  # and not activated
        with pytest.raises(UaError):
            await client.nodes.objects.get_children()
        flood = [await asyncio.open_connection("127.0.0.1", port) for _ in range(40)]
        for reader, writer in flood:
            writer.write(b"HELF\xff\xff\xff\x7f")  # much is to follow
            with suppress(ConnectionError):
                await reader.read()
            writer.close()
        client.disconnect_socket()
        async with reading(address, client_files) as known:
            assert await results(known, cell) == {}


async def test_anybody_may_read_only_where_the_cell_says_so(cell, client_files, monkeypatch) -> None:
    for variable in ("HEXACELL_OPCUA_USER", "HEXACELL_OPCUA_PASSWORD"):
        monkeypatch.delenv(variable)
    with pytest.raises(UsageError, match="nobody may read"):
        async with serving(cell):
            pass
    runs_folder(cell).parent.mkdir()
    runs_folder(cell).write_text("no folder")
    warnings: list[str] = []
    async with (
        serving(cell, warnings.append, anonymous=True) as address,
        reading(address, client_files, None) as client,
    ):
        assert await results(client, cell) == {}
    assert warnings


async def test_a_password_that_others_can_read_and_a_port_that_is_taken_are_refused(cell, monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        settings = OpcUaSettings(port=taken.getsockname()[1])
        with pytest.raises(DeviceError, match="cannot be served"):
            await server.serve_results(cell, settings, lambda _: None, lambda _: None)
    assert server.allowed_reader(settings, cell.path.parent) == server.Reader(Login(USER, PASSWORD)), (
        "of the environment"
    )
    monkeypatch.delenv("HEXACELL_OPCUA_USER")
    password_file(cell, 0o644)
    with pytest.raises(FileError, match="chmod 600") as raised:
        async with serving(cell, password_file=READER_FILE):
            pass
    assert PASSWORD not in str(raised.value)


def test_its_certificate_stays_and_its_key_is_its_own(tmp_path) -> None:
    folder = tmp_path / "opcua"
    first = [path.read_bytes() for path in ensure_certificate(folder, "urn:x", "127.0.0.1")]
    again = [path.read_bytes() for path in ensure_certificate(folder, "urn:x", "127.0.0.1")]
    assert first == again
    assert stat.S_IMODE((folder / "private-key.pem").stat().st_mode) == 0o600
    assert x509.load_der_x509_certificate(first[0]).not_valid_after_utc.year >= 2036
