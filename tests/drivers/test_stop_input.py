"""The stop input forbids motion while it is active, and while its state is unknown."""

from pathlib import Path
from typing import Any

import pytest
import serial

from drivers.stop_input import CombinedStopInput, stop_input_of
from hexacell.cell.measuring import GuardSettings
from hexacell.errors import DeviceError


class Port:
    """A serial port with modem lines, as pyserial has it; a contact joins outputs and inputs."""

    def __init__(self) -> None:
        self.dtr = self.rts = False
        self.contact_closed = True
        self.broken: OSError | None = None
        self.is_open = False

    def open(self) -> None:
        if self.broken:
            raise self.broken
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def _through(self, output: bool) -> bool:
        if self.broken:
            raise self.broken
        return self.contact_closed and output

    @property
    def dsr(self) -> bool:
        return self._through(self.dtr)

    @property
    def cts(self) -> bool:
        return self._through(self.rts)


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    made = Port()
    monkeypatch.setattr(serial, "serial_for_url", lambda url, do_not_open: made)
    return made


async def test_without_a_stop_input_motion_is_allowed() -> None:
    line = stop_input_of(GuardSettings(), Path())
    assert await line.open() is None
    assert await line.active_reason() is None
    await line.close()


async def test_a_stop_file_that_exists_or_cannot_be_checked_forbids_motion(tmp_path) -> None:
    line = stop_input_of(GuardSettings(stop_file="stop"), tmp_path)
    assert await line.open() is None, "a file is no device"
    assert await line.active_reason() is None
    (tmp_path / "stop").touch()
    assert await line.active_reason() == f"{tmp_path}/stop exists"
    (tmp_path / "stop").unlink()
    assert await line.active_reason() is None
    (tmp_path / "stop").symlink_to("nowhere")
    assert await CombinedStopInput(tmp_path / "stop").active_reason() is not None
    (tmp_path / "file").touch()
    assert "cannot be checked" in (
        await CombinedStopInput(tmp_path / "file" / "stop").active_reason() or ""
    )


@pytest.mark.parametrize("contact", ["dsr", "cts"])
async def test_an_open_contact_forbids_motion(port: Port, contact: Any) -> None:
    settings = GuardSettings(stop_port="/dev/ttyS9", stop_contact=contact)
    line = stop_input_of(settings, Path())
    identity = await line.open()
    assert identity is not None
    assert identity.description == f"{contact.upper()} of /dev/ttyS9"
    assert await line.active_reason() is None
    port.contact_closed = False
    assert "of /dev/ttyS9 is open" in (await line.active_reason() or "")
    port.contact_closed = True
    assert await line.active_reason() is None
    await line.close()
    assert not port.is_open


async def test_an_unplugged_adapter_forbids_motion(port: Port) -> None:
    line = stop_input_of(GuardSettings(stop_port="/dev/ttyS9"), Path())
    await line.open()
    port.broken = OSError(5, "Input/output error")
    assert "was lost" in (await line.active_reason() or "")
    await line.close()
    await line.close()


async def test_a_contact_that_is_not_opened_forbids_motion(port: Port) -> None:
    line = CombinedStopInput(None, "/dev/ttyS9")
    assert "is not open" in (await line.active_reason() or "")
    await line.open()
    await line.close()
    assert "is not open" in (await line.active_reason() or "")


async def test_a_port_that_is_absent_is_refused(tmp_path: Path) -> None:
    line = stop_input_of(GuardSettings(stop_port=str(tmp_path / "nothing")), Path())
    with pytest.raises(DeviceError, match=r"stop line: port .*nothing is absent"):
        await line.open()


async def test_a_port_without_modem_lines_is_refused_or_forbids() -> None:
    """A pseudo-terminal has none and could never stop the robot, so it must not be taken for a contact."""
    import os

    near, far = os.openpty()
    line = CombinedStopInput(None, os.ttyname(far), "dsr")
    try:
        try:
            await line.open()
        except DeviceError:
            return
        assert await line.active_reason() is not None
    finally:
        await line.close()
        os.close(near)
        os.close(far)


async def test_all_active_stop_inputs_are_named(port: Port, tmp_path: Path) -> None:
    line = stop_input_of(GuardSettings(stop_file="stop", stop_port="/dev/ttyS9"), tmp_path)
    await line.open()
    port.contact_closed = False
    (tmp_path / "stop").touch()
    words = await line.active_reason() or ""
    assert "stop exists" in words
    assert "is open" in words
