"""A device that answers again must be the one of before."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.interfaces import DeviceIdentity
from procedures.devices.reconnection import DeviceReplaced, require_known

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
