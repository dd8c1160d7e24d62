"""A PLC is driven as any controller is, by certificate and password, and by one client only."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager
from pydantic import ValidationError

from drivers import conformance
from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.opcua.controller import OpcUaController
from drivers.controllers.opcua.options import VARIABLES, OpcUaOptions
from drivers.controllers.opcua.program import Plc
from drivers.interfaces import Controller, StartupAction
from drivers.wire_trace import WireTrace
from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from hexacell.errors import DeviceError, UsageError
from hexacell.kinematics.pose import Pose
from tests.drivers.conformance.test_controllers import MachineInTime
from tests.drivers.controllers.opcua.plc import VT, PlcServer

ALL = frozenset(StartupAction)
PASSWORD = "not in any trace"


def settings_of(options: OpcUaOptions) -> ControllerSettings:
    return ControllerSettings(config="machine.ini", protocol="opcua", options=options)


class PlcTwin:
    """The PLC of these tests."""

    target = Pose(100.0, -200.0, 550.0, 12.5, -3.0, 8.0)
    out_of_reach = Pose(0.0, 0.0, 2000.0)

    def __init__(self, server: PlcServer) -> None:
        self.settings = settings_of(server.options)
        self._server = server

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        match fault:
            case "unplugged":
                self._server.set_unplugged(on=on)
            case "silent":
                self._server.set_silent(on=on)
            case _:
                self._server.program.press_estop()


class TestOpcUa(conformance.ControllerConformance):
    @pytest.fixture(autouse=True)
    def _served(self, server: PlcServer) -> None:
        self._server = server

    def driver(self, settings: ControllerSettings) -> Controller:
        return OpcUaController(settings)

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        yield PlcTwin(self._server)


class OnlyHexacell(UserManager):
    """One user."""

    def get_user(self, _iserver, username=None, password=None, certificate=None):
        return User(role=UserRole.User) if (username, password) == ("hexacell", PASSWORD) else None


async def test_it_logs_in_over_an_encrypted_connection_and_no_trace_has_the_password(
    tmp_path: Path, monkeypatch
) -> None:
    trace = WireTrace()
    login = tmp_path / "plc.toml"
    login.write_text(f'user = "hexacell"\npassword = "{PASSWORD}"\n')
    login.chmod(0o600)
    server = await asyncio.to_thread(
        lambda: PlcServer(MachineInTime(), real=VT.Float, folder=tmp_path, users=OnlyHexacell())
    )
    server.cycle_s = 0.1
    try:
        options = server.options.model_copy(
            update={
                "password_file": "plc.toml",
                "folder": "client",
                "server_certificate": "certificate.der",
            }
        )
        controller = OpcUaController(settings_of(options.beside(tmp_path)), trace=trace)
        await controller.open()
        await controller.prepare(ALL)
        await controller.move(PlcTwin.target, 0.05)
        await controller.close()
        assert (tmp_path / "client" / "private-key.pem").stat().st_mode & 0o777 == 0o600
        assert PASSWORD not in trace.text()
        monkeypatch.setenv(VARIABLES["password"], "another")
        with pytest.raises(DeviceError, match="BadUserAccessDenied"):
            await controller.open()
        await controller.close()
    finally:
        await asyncio.to_thread(server.close)


def test_who_comes_second_is_refused(server: PlcServer) -> None:
    first, told = Plc(), {"settings": server.options.model_dump(mode="json")}
    first.hello(told)
    try:
        with pytest.raises(FailedError, match="another program commands this PLC"):
            Plc().hello(told)
        first.start_up("reset-estop")
    finally:
        first.close()


@pytest.mark.parametrize(
    ("told", "mistake"),
    [
        ({"endpoint": "opc.tcp://me:secret@plc"}, "endpoint"),
        ({"node": ""}, "no node id for execute"),
        ({"nodes": {"stopp": "i=7"}}, "there is no node 'stopp'"),
        ({"nodes": {"stop": ""}}, "no node id for stop"),
        ({"nodes": {"pose": ["i=7"] * 5}}, "nodes.pose"),
        ({"nodes": {"pose": "seven"}}, "nodes.pose"),
    ],
)
def test_mistakes_of_the_cell_file_are_named(told: dict[str, Any], mistake: str) -> None:
    right = {"endpoint": "opc.tcp://plc:4840", "node": "ns=3;s={name}", "nodes": {"pose": ["i=7"] * 6}}
    with pytest.raises(ValidationError, match=mistake):
        OpcUaOptions.model_validate_json(json.dumps(right | told))
    assert len(OpcUaOptions.model_validate_json(json.dumps(right)).node_ids()["pose"]) == 6


def test_no_password_is_sent_in_clear(server: PlcServer, monkeypatch) -> None:
    for variable in VARIABLES.values():
        monkeypatch.setenv(variable, PASSWORD)
    with pytest.raises(UsageError, match="in clear"):
        server.options.login()
