"""A driver from elsewhere that lets the errors of its libraries through."""

from __future__ import annotations

import termios

import can
import pytest
import serial
from canopen import SdoCommunicationError

from drivers.errors import GaugeSilent
from drivers.libraries import translated
from hexacell.errors import DeviceError


class Elsewhere:
    """A device whose calls fail as stated."""

    name = "x"

    def __init__(self, error: Exception | None) -> None:
        self.error = error

    async def read(self, value: float) -> float:
        if self.error is not None:
            raise self.error
        return value


@pytest.mark.parametrize(
    "error",
    [
        serial.SerialException("device disconnected"),
        can.CanOperationError("bus off"),
        SdoCommunicationError("no response"),
        termios.error(5, "Input/output error"),
        ConnectionResetError(104, "reset by peer"),
        TimeoutError("timed out"),
        EOFError("nothing more"),
    ],
    ids=lambda error: type(error).__name__,
)
async def test_errors_of_libraries_and_of_the_system_name_the_device(error: Exception) -> None:
    with pytest.raises(DeviceError, match="gauge x: its driver failed: ") as caught:
        await translated(Elsewhere(error), "gauge x").read(1.0)
    assert caught.value.__cause__ is error
    assert type(error).__name__ in str(caught.value)


@pytest.mark.parametrize("error", [GaugeSilent("is silent", subject="gauge x"), ZeroDivisionError("a bug")])
async def test_other_errors_stay_what_they_are(error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        await translated(Elsewhere(error), "gauge x").read(1.0)
    assert caught.value is error


async def test_everything_else_is_the_device() -> None:
    device = translated(Elsewhere(None), "gauge x")
    assert device.name == "x"
    assert await device.read(2.0) == 2.0
