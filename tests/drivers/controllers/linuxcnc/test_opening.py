"""Opening and closing: the greeting, and errors for unexpected or missing answers."""

import asyncio
import socket

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.shell_connection import without_passwords
from drivers.errors import ConnectionLost, ResponseTimeout
from drivers.interfaces import DeviceIdentity
from drivers.wire_trace import WireTrace
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError, ExitCode, UsageError
from tests.drivers.controllers.linuxcnc.conftest import HELLO, Then, once
from tests.waiting import cancel, until

GREETING = [HELLO, "set echo off", "set verbose on"]


async def test_opening_greets_takes_control_and_orders_nothing_else(make, controller) -> None:
    identity = await make().open()
    name = f"controller 127.0.0.1:{controller.port}"
    assert identity == DeviceIdentity(name, "linuxcncrsh", "EMCNETSVR 1.1, machine.ini")
    asked = ["set enable EMCTOO", "set set_wait done", *GREETING, "get inifile", "get error"]
    assert controller.lines == [*GREETING, *asked], "who only asks does not take control"


async def test_servers_of_other_versions_are_opened(make, controller) -> None:
    warning = b"warning: Requested version '1.0' is newer than '0.9'\r\nHELLO ACK EMCNETSVR 0.9\r\n"
    unknown = b"error: Subcommand not found: SET set_wait\r\nSET NAK\r\n"
    known = b"SET WAIT_MODE ACK\r\n"
    controller.says = {
        "set set_wait": unknown,
        "set wait_mode": known,
        "get inifile": b"GET INIFILE NAK\r\n",
    }
    controller.says |= {"set echo": Then.SAY_NOTHING}
    assert (await make().open()).description == "EMCNETSVR 1.1"
    assert controller.count("set wait_mode done") == 1
    controller.says |= {"set set_wait": known, "hello EMC": once(warning)}
    assert (await make().open()).description == "EMCNETSVR 0.9"
    assert controller.count("set wait_mode done") == 1


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        (b"HELLO NAK\r\n", "refuses the connect password"),
        (b"SSH-2.0-OpenSSH_9.2p1\r\n", "is no linuxcncrsh, it says 'SSH-2.0-OpenSSH_9.2p1'"),
        (b"HTTP/1.1 400 Bad Request\r\nServer: x\r\n", "it says 'HTTP/1.1 400 Bad Request'"),
        (b"login: ", "is no linuxcncrsh, it says 'login:'"),
        (b"\xff\xfd\x18" * 1000, "is no linuxcncrsh, it says"),
    ],
)
async def test_an_unexpected_answer_to_the_greeting_is_quoted(make, controller, said, problem) -> None:
    controller.says["hello EMC"] = said
    with pytest.raises(DeviceError, match=problem) as caught:
        await make().open()
    assert not isinstance(caught.value, ConnectionLost)
    assert f"127.0.0.1:{controller.port}" in str(caught.value)
    assert len(str(caught.value)) < 400
    assert caught.value.exit_code is ExitCode.HARDWARE


async def test_a_refused_enable_password_is_reported_and_one_too_long_not_sent(make, controller) -> None:
    with pytest.raises(DeviceError, match="refuses the enable password") as caught:
        await make(enable_password="sesame").open()
    assert "sesame" not in str(caught.value)
    with pytest.raises(DeviceError, match="longer than the 255"):
        await make(connect_password="x" * 300).open()
    assert max(map(len, controller.lines)) < 300


@pytest.mark.parametrize("password", ["EMC", "EMCTOO"])
async def test_passwords_stay_out_of_the_trace(make, controller, password) -> None:
    trace = WireTrace()
    await make(trace).open()
    sent = b"".join(entry.data for entry in trace.entries() if entry.direction == ">")
    assert sent.startswith(
        b"hello *** hexacell 1.0\r\nset echo off\r\nset verbose on\r\nset enable ***\r\n"
    )
    assert "machine.ini" in trace.text()
    settings = ControllerSettings(config="robot.toml", connect_password=password)
    for shown in (b"set enable EMCTOO\r\n", b"hello EMC hexacell 1.0\r\n", b"set enable EMCTOO"):
        assert password.encode() not in without_passwords(shown, settings).split()


async def test_what_cannot_be_connected_to_is_reported(make, controller, monkeypatch) -> None:
    with pytest.raises(UsageError, match="names no controller port"):
        LinuxcncrshController(ControllerSettings(config="x"))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(ConnectionLost, match=f"127.0.0.1:{port}: .* reached: Conn.*Start LinuxCNC"):
            await make(port=port).open()
    for error, told in (
        (socket.gaierror(-2, "No such name"), "No such name.*controller.host"),
        (OSError(113, ""), "No route.*Switch its"),
        (TimeoutError("timed out"), "cannot be reached within 3 s.*firewall"),
    ):

        def fails(*_where: object, error: OSError = error, **_named: object) -> socket.socket:
            raise error

        monkeypatch.setattr(socket, "create_connection", fails)
        with pytest.raises(ConnectionLost, match=told):
            await make(host="far").open()


async def test_an_opening_that_fails_leaves_it_closed_and_can_be_repeated(make, controller) -> None:
    driver = make()
    controller.says["hello EMC"] = once(Then.SAY_NOTHING)
    with pytest.raises(ResponseTimeout, match="accepts the connection but does not respond"):
        await driver.open()
    controller.says["hello EMC"] = once(Then.HANG_UP)
    with pytest.raises(ConnectionLost, match=r"takes no more clients .*without --sessions"):
        await driver.open()
    with pytest.raises(DeviceError, match="is not connected"):
        await driver.position()
    await driver.open()


@pytest.mark.parametrize("how", ["cancelled", "closed"])
async def test_an_opening_that_is_broken_off_leaves_nothing_behind(make, controller, how) -> None:
    controller.says["set verbose"] = Then.SAY_NOTHING
    driver = make()
    opening = asyncio.create_task(driver.open())
    await until(lambda: controller.count("set verbose") > 0)
    if how == "cancelled":
        await cancel(opening)
    else:
        await driver.close()
        with pytest.raises(DeviceError):
            await opening


async def test_closing_ends_what_waits_for_an_answer(driver, controller) -> None:
    controller.says["get joint_homed"] = Then.SAY_NOTHING
    asking = asyncio.create_task(driver.position())
    await until(lambda: controller.count("get joint_homed") > 0)
    await driver.close()
    with pytest.raises(DeviceError):
        await asking
