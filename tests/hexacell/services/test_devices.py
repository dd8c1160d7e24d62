"""What preflight tells of devices and of the cell's computer; nothing moves, and nothing is left behind."""

import asyncio
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.interfaces import DeviceIdentity
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import WireTrace
from hexacell.campaign import feasibility
from hexacell.cell.loader import load_cell
from hexacell.errors import CellBusy, DeviceError
from hexacell.runs.cell_lock import cell_lock
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.devices.device_setup import device_addresses, devices_of, open_devices
from hexacell.services.history.recorded_cell import with_changes
from hexacell.services.preflight import accepts_from_network, is_loopback, port_warnings
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
            assert found == settings


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


CELL = Path(__file__).parents[3] / "configs" / "simulated-hexaglide.toml"


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="no tables of this kernel")
def test_a_server_for_all_addresses_is_found() -> None:
    for host, reachable in (("127.0.0.1", False), ("0.0.0.0", True)):
        with socket.create_server((host, 0)) as server:
            assert accepts_from_network(server.getsockname()[1]) is reachable


def test_addresses_are_read_as_the_kernel_writes_them(tmp_path: Path) -> None:
    head = "  sl  local_address rem_address   st\n"
    (tmp_path / "tcp").write_text(
        f"{head}   0: 0100007F:1390 00000000:0000 0A 0\n   1: 0A01A8C0:1391 00000000:0000 0A 0\n"
        "   2: 0A01A8C0:1392 00000000:0000 01 0\nrubbish\n"
    )
    loopback6, any6 = "0" * 24 + "01000000", "0" * 32
    (tmp_path / "tcp6").write_text(
        f"{head}   0: {loopback6}:1390 {any6}:0000 0A 0\n   1: {any6}:1393 {any6}:0000 0A 0\n"
    )
    tables = [tmp_path / "tcp", tmp_path / "tcp6", tmp_path / "absent"]
    ports = (5008, 5009, 5010, 5011)
    assert [accepts_from_network(port, tables) for port in ports] == [False, True, False, True]


def test_names_of_this_computer() -> None:
    assert all(map(is_loopback, ("127.0.0.1", "::1", "LocalHost")))
    assert not any(map(is_loopback, ("192.168.1.7", "robot")))


@pytest.mark.parametrize(
    ("port", "told"),
    [
        ("/dev/ttyUSB0", ["its adapter keeps bytes for 16 ms", "tomorrow /dev/ttyUSB0 may be another"]),
        ("/dev/ttyACM1", ["tomorrow /dev/ttyACM1 may be another"]),
        ("by-id", ["its adapter keeps bytes for 16 ms"]),
        ("socket://nowhere:4001", []),
    ],
)
def test_late_adapters_and_passing_names_are_told_once_a_port(tmp_path, monkeypatch, port, told) -> None:
    monkeypatch.chdir(tmp_path)
    Path("by-id").symlink_to("ttyUSB0")
    for device, wait in (("ttyUSB0", "16"), ("ttyACM1", "1")):
        (tmp_path / "sys" / device).mkdir(parents=True)
        (tmp_path / "sys" / device / "latency_timer").write_text(f"{wait}\n")
    cell = load_cell(CELL)
    gauges = [one.model_copy(update={"port": port}) for one in cell.settings.gauges]
    real = cell.settings.model_copy(update={"gauges": tuple(gauges), "simulation": None})
    found = list(port_warnings(replace(cell, settings=real), tmp_path / "sys"))
    assert [line.partition(": ")[2].partition(": docs/howto-host.md")[0] for line in found] == told


async def check(site):
    return await preflight(site.order().cell, Mode.OPTIMISE, unattended=True)


async def test_a_ready_cell_gives_its_devices_and_nothing_moves(make_site) -> None:
    site = make_site()
    before = site.simulated.machine.joints()
    site.simulated.physics.gauges.station += np.array([9.0, -9.0, 0.0])  # which is seen to when it runs
    identities = await check(site)
    names = [identity.name for identity in identities]
    assert names[:3] == ["x", "y", "z"]
    assert len(names) == 10
    assert site.simulated.machine.joints() == before
    assert not site.simulated.controller.state.enabled, "not even switched on"
    with cell_lock(site.cell.config_path), pytest.raises(CellBusy):
        await check(site)


async def test_a_stop_during_the_checks_of_the_plan_leaves_nothing(make_site, monkeypatch) -> None:
    site = make_site()
    loop = asyncio.get_running_loop()
    run = asyncio.ensure_future(site.calibrate())

    def told_to_stop(_plan: object) -> tuple[()]:
        loop.call_soon_threadsafe(run.cancel)
        return ()

    monkeypatch.setattr(feasibility, "reach_failures", told_to_stop)
    with pytest.raises(asyncio.CancelledError):
        await run
    assert not site.folder.path.exists()
    assert not site.simulated.controller.state.enabled, "not even switched on"
    with cell_lock(site.cell.config_path):
        pass
