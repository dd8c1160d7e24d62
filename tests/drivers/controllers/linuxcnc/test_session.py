"""Opening and closing: the greeting, and errors for unexpected or missing answers."""

import asyncio
import socket
from unittest.mock import AsyncMock

import pytest

from drivers.controllers.linuxcnc.connection import without_passwords
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.protocol import Timeouts
from drivers.errors import ConnectionLost, ResponseTimeout
from drivers.interfaces import DeviceIdentity
from drivers.wire_trace import WireTrace
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError, ExitCode, UsageError
from tests.drivers.controllers.linuxcnc.conftest import said
from tests.linuxcnc_orders import pose_of
from tests.waiting import cancel

HELLO = "hello EMC hexacell 1.0"


async def test_opening_greets_takes_control_and_orders_nothing_else(play):
    driver = await play.driver(play.OPENING)
    identity = await driver.open()
    name = f"controller 127.0.0.1:{play.servers[0].port}"
    assert identity == DeviceIdentity(name, "linuxcncrsh", "EMCNETSVR 1.1, machine.ini")


async def test_servers_of_other_versions_are_opened(play) -> None:
    newer = b"warning: Requested version '1.0' is newer than '0.9'\r\nHELLO ACK EMCNETSVR 0.9\r\n"
    unknown = ("set set_wait done", b"error: Subcommand not found: SET set_wait\r\nSET NAK\r\n")
    then = said("get enable: ON | get error: OK | set wait_mode done | get inifile: /a/b.ini")
    driver = await play.driver([(HELLO, newer), *play.GREETING[1:], unknown, *then])
    assert (await driver.open()).description == "EMCNETSVR 0.9, b.ini"
    greeting = [(HELLO, b"\r\n\r\nHELLO ACK EMCNETSVR 1.1\n\r"), ("set echo off", play.SILENCE)]
    alias = [*play.GREETING[2:], ("set set_wait done", b"SET WAIT_MODE ACK\r\n")]
    no_file = [("get inifile", b"GET INIFILE NAK\r\n\r\n")] * 2
    driver = await play.driver([*greeting, *alias, *no_file])
    assert (await driver.open()).description == "EMCNETSVR 1.1"


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
async def test_an_unexpected_answer_to_the_greeting_is_quoted(play, said, problem):
    play.patience = play.IMPATIENT
    driver = await play.driver([(HELLO, said)])
    with pytest.raises(DeviceError, match=problem) as caught:
        await driver.open()
    assert not isinstance(caught.value, ConnectionLost)
    assert f"127.0.0.1:{play.servers[0].port}" in str(caught.value)
    assert len(str(caught.value)) < 400
    assert caught.value.exit_code is ExitCode.HARDWARE


async def test_a_refused_enable_password_is_reported(play):
    refused = [*play.GREETING[:3], *said("set enable sesame: NAK")]
    driver = await play.driver(refused, enable_password="sesame")
    with pytest.raises(DeviceError, match="refuses the enable password") as caught:
        await driver.open()
    assert "sesame" not in str(caught.value)


async def test_opening_without_a_listening_server_is_reported():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        driver = LinuxcncrshController(ControllerSettings(config="x", port=port))
        with pytest.raises(ConnectionLost, match=f"127.0.0.1:{port}: .* reached: Conn.*Start LinuxCNC"):
            await driver.open()


HOSTS = [(socket.gaierror(-2, "No such name"), "controller.host"), (OSError(113, ""), "Switch its")]


@pytest.mark.parametrize(("error", "told"), HOSTS)
async def test_a_host_that_cannot_be_reached_is_not_told_as_linuxcnc_that_is_off(monkeypatch, error, told):
    monkeypatch.setattr(asyncio, "open_connection", AsyncMock(side_effect=error))
    with pytest.raises(ConnectionLost, match=f"cannot be reached: No .*{told}"):
        await LinuxcncrshController(ControllerSettings(config="x", host="far", port=5007)).open()


async def test_opening_times_out_if_the_host_does_not_accept_the_connection(monkeypatch):
    monkeypatch.setattr(asyncio, "open_connection", lambda *_where: asyncio.Event().wait())
    settings = ControllerSettings(config="x", host="far", port=5007)
    driver = LinuxcncrshController(settings, timeouts=Timeouts(connect=0.01))
    with pytest.raises(ConnectionLost, match=r"far:5007: cannot be reached within 0\.01 s.*its firewall"):
        await driver.open()


async def test_an_opening_that_fails_is_told_leaves_it_closed_and_can_be_repeated(play) -> None:
    play.patience = play.IMPATIENT
    driver = await play.driver([(HELLO, play.SILENCE)])
    with pytest.raises(ResponseTimeout, match="accepts the connection but does not respond"):
        await driver.open()
    driver = await play.driver([(HELLO, play.HANG_UP)], play.OPENING)
    with pytest.raises(ConnectionLost, match=r"takes no more clients .*without --sessions"):
        await driver.open()
    with pytest.raises(DeviceError, match="is not connected"):
        await pose_of(driver)
    await driver.open()


async def test_a_cell_file_without_a_controller_port_is_refused():
    with pytest.raises(UsageError, match="names no controller port"):
        LinuxcncrshController(ControllerSettings(config="x"))


async def test_a_password_that_would_overrun_the_servers_buffer_is_not_sent(play):
    driver = await play.driver([], connect_password="x" * 300)
    with pytest.raises(UsageError, match="longer than the 255"):
        await driver.open()


async def test_a_cancelled_opening_leaves_nothing_behind(play):
    never = play.Pause()
    driver = await play.driver([*play.GREETING[:2], ("set verbose on", never)])
    await cancel(await never.reached_by(driver.open()))


async def test_closing_during_opening_ends_the_opening(play):
    greeted = play.Pause()
    driver = await play.driver(
        [*play.GREETING[:2], ("set verbose on", greeted, b"SET VERBOSE ACK\n\r"), *play.OPENING[3:5]]
    )
    opening = await greeted.reached_by(driver.open())
    await driver.close()
    greeted.set()
    with pytest.raises(DeviceError, match="is not connected"):
        await opening


@pytest.mark.parametrize(
    ("shown", "masked"),
    [
        (b"set enable EMCTOO\r\n", b"set enable ***\r\n"),
        (b"hello EMC hexacell 1.0\r\n", b"hello *** hexacell 1.0\r\n"),
        (b"set enable EMCTOO", b"set enable ***"),
        (b"HELLO ACK EMCNETSVR 1.1\r\n", b"HELLO ACK EMCNETSVR 1.1\r\n"),
    ],
)
def test_a_password_that_begins_with_the_other_is_masked_whole(shown, masked):
    assert without_passwords(shown, ControllerSettings(config="robot.toml")) == masked


async def test_passwords_stay_out_of_the_trace(play):
    trace = WireTrace()
    hello = ("hello knock hexacell 1.0", b"HELLO ACK EMCNETSVR 1.1\r\n")
    opening = [hello, *play.GREETING[1:3], *said("set enable sesame"), *play.OPENING[4:]]
    passwords = {"connect_password": "knock", "enable_password": "sesame"}
    driver = await play.driver(opening, trace=trace, **passwords)
    await driver.open()
    sent = b"".join(entry.data for entry in trace.entries() if entry.direction == ">")
    assert sent.startswith(
        b"hello *** hexacell 1.0\r\nset echo off\r\nset verbose on\r\nset enable ***\r\n"
    )
    assert "machine.ini" in trace.text()
