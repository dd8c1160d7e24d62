"""A device that answers again must be the one of before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import pytest

from drivers.interfaces import DeviceIdentity
from hexacell.cell.devices import GaugeAxis
from hexacell.errors import DeviceError
from procedures.devices.device_set import Devices, MountedGauge
from procedures.devices.reconnection import DeviceReplaced, reconnect, require_known

BEFORE = DeviceIdentity(
    "x", "mux10", "Mitutoyo MUX-10 channel", settings="preset 0", port="USB 0403:6001 socket 1-1"
)


@pytest.mark.parametrize(
    "change",
    [
        {"port": "USB 0403:6001 socket 1-2"},
        {"settings": "preset 500"},
        {"description": "another"},
        {"serial_number": "7"},
    ],
)
def test_another_port_or_setting_is_another_device(change: dict[str, str]) -> None:
    now = replace(BEFORE, **change)
    with pytest.raises(DeviceReplaced, match=next(iter(change.values()))):
        require_known([now], [BEFORE])


def test_what_a_journal_of_before_does_not_tell_is_not_compared() -> None:
    require_known([BEFORE], [replace(BEFORE, settings="", port="")])


def test_a_remark_is_not_compared() -> None:
    require_known([replace(BEFORE, remark="it reports a warning")], [BEFORE])


class Answering:
    """A gauge that counts how often it was opened."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.opened = 0

    async def open(self) -> DeviceIdentity:
        self.opened += 1
        return DeviceIdentity(self.name, "mine", "from elsewhere")

    async def close(self) -> None:
        """Nothing to release."""


async def test_a_gauge_whose_driver_has_no_better_word_for_it_is_opened_again() -> None:
    gauges = [Answering(name) for name in "xyz"]
    mounted = tuple(MountedGauge(cast("Any", gauge), GaugeAxis(n, 1)) for n, gauge in enumerate(gauges))
    devices = Devices(mounted, encoders=cast("Any", None), controller=cast("Any", None))
    assert await reconnect(devices, DeviceError("has failed", subject="gauge y"), [])
    assert [gauge.opened for gauge in gauges] == [0, 1, 0]
