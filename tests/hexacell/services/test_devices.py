"""Drivers composed by name, and what differs from the last run."""

from dataclasses import replace

import pytest

from drivers.interfaces import DeviceIdentity
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.errors import DeviceError
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.devices.device_setup import device_addresses, devices_of, open_devices
from hexacell.services.history.recorded_cell import with_changes
from hexacell.services.run.calibration_run import new_calibration, preflight, run_started
from procedures.calibration.calibration import Mode
from tests.recorded_events import record


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


GAUGE = DeviceIdentity("x", "mux10", "MUX-10F 1.0", port="1-1.2")
ENCODER = DeviceIdentity("encoder of leg 3 (node 3)", "cia406", "absolute linear", "503", "preset 0")


@pytest.fixture
def cell(make_cell):
    return make_cell()


def kept(cell, name: str, *devices: DeviceIdentity) -> RunFolder:
    folder = RunFolder(runs_folder(cell) / name)
    folder.create(cell)
    record(folder.journal, [run_started(cell, new_calibration(cell, Mode.OPTIMISE), devices)])
    return folder


def test_an_encoder_that_was_set_since_the_last_run_is_told(cell) -> None:
    kept(cell, "2026-11-01T000000Z", GAUGE, replace(ENCODER, settings="preset 7"))
    kept(cell, "2026-11-02T000000Z", GAUGE, ENCODER)
    now = replace(ENCODER, settings="preset 500", remark="it reports a warning")
    gauge, encoder = with_changes(cell, (GAUGE, now))
    assert gauge.remark == ""
    since = "since the run 2026-11-02T000000Z: settings preset 500, which was preset 0"
    assert encoder.remark == f"it reports a warning; {since}"
    assert encoder == now, "a remark is not compared"


def test_an_exchanged_device_and_another_port_are_told(cell) -> None:
    kept(cell, "2026-11-02T000000Z", GAUGE, ENCODER)
    gauge, encoder = with_changes(cell, (replace(GAUGE, port="1-1.3"), replace(ENCODER, serial_number="9")))
    assert gauge.remark.endswith("port 1-1.3, which was 1-1.2")
    assert encoder.remark.endswith("serial number 9, which was 503")


def test_what_no_run_told_is_no_change(cell) -> None:
    assert [one.remark for one in with_changes(cell, (GAUGE, ENCODER))] == ["", ""]
    kept(cell, "2026-11-02T000000Z", replace(GAUGE, port=""), replace(ENCODER, settings=""))
    assert [one.remark for one in with_changes(cell, (GAUGE, ENCODER))] == ["", ""]


def test_a_run_that_cannot_be_read_is_passed_over(cell) -> None:
    kept(cell, "2026-11-01T000000Z", ENCODER)
    damaged = kept(cell, "2026-11-02T000000Z", replace(ENCODER, settings="preset 7"))
    damaged.journal.write_bytes(b"nothing\n")
    (runs_folder(cell) / "2026-11-03T000000Z").mkdir()
    [encoder] = with_changes(cell, (replace(ENCODER, settings="preset 1"),))
    assert "since the run 2026-11-01T000000Z: settings preset 1, which was preset 0" in encoder.remark


async def test_preflight_tells_it(cell) -> None:
    found = await preflight(cell, Mode.OPTIMISE, unattended=True)
    before = [replace(one, serial_number="1") if one.name == "x" else one for one in found]
    kept(cell, "2026-11-02T000000Z", *before)
    again = await preflight(cell, Mode.OPTIMISE, unattended=True)
    told = {one.name: one.remark for one in again if one.remark}
    assert list(told) == ["x"]
    assert "which was 1" in told["x"]
