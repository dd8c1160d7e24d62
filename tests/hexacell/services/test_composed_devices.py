"""Drivers loaded by name, opened together and closed together."""

from dataclasses import replace

import pytest

from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.errors import DeviceError
from hexacell.services.devices.device_setup import device_addresses, devices_of, open_devices


def test_axes_and_signs_are_the_files(make_site) -> None:
    site = make_site()
    gauges = site.simulated.settings.gauges
    turned = (
        gauges[0].model_copy(update={"axis": "z", "sign": -1}),
        gauges[1],
        gauges[2].model_copy(update={"axis": "x"}),
    )
    settings = site.simulated.settings.model_copy(update={"gauges": turned})
    devices = devices_of(settings, SharedSerialPorts(), WireTrace())
    assert [(mounted.axis.index, mounted.axis.sign) for mounted in devices.gauges] == [
        (2, -1),
        (1, 1),
        (0, 1),
    ]


async def test_if_one_device_cannot_be_opened_or_something_fails_all_are_closed(make_site) -> None:
    """The test harness finds open descriptors; afterwards all devices can be opened again."""
    site = make_site()
    site.simulated.gauges.indicators["y"].inch = True
    with pytest.raises(DeviceError, match="gauge y"):
        async with open_devices(site.simulated.settings):
            pytest.fail("was connected")
    site.simulated.gauges.indicators["y"].inch = False
    with pytest.raises(ZeroDivisionError):
        async with open_devices(site.simulated.settings):
            raise ZeroDivisionError
    async with open_devices(site.simulated.settings):
        pass


def test_a_simulated_cell_is_served_while_the_context_lasts(make_cell) -> None:
    cell = make_cell()
    with device_addresses(cell) as settings:
        assert settings.simulation is None
        assert settings.controller.port
        assert (settings.encoders.bus or {})["interface"] == "virtual"
    with device_addresses(cell, other_processes=True) as settings:
        assert (settings.encoders.bus or {})["interface"] == "slcan"
        real = replace(cell, settings=settings)
        with device_addresses(real) as found:
            assert found is settings
