"""Text for devices: one line each, then what else was checked."""

from __future__ import annotations

from drivers.interfaces import DeviceIdentity
from hexacell.text.planning import device_line, preflight_lines

GAUGE = DeviceIdentity(name="x", protocol="sylvac", description="SY276")
ENCODER = DeviceIdentity(
    name="encoder of leg 1", protocol="cia406", description="linear", serial_number="1001"
)


def test_a_serial_number_is_named_if_there_is_one():
    assert device_line(GAUGE) == "x, sylvac: SY276"
    assert device_line(ENCODER) == "encoder of leg 1, cia406, serial number 1001: linear"


def test_a_preflight_names_every_device_and_that_nothing_moved():
    first, second, third, _ = preflight_lines([GAUGE, ENCODER])
    assert (first, second) == (f"ok  {device_line(GAUGE)}", f"ok  {device_line(ENCODER)}")
    assert third.endswith("nothing was moved")
