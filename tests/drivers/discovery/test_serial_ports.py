"""Serial ports: which questions are asked on a line in which order, and the adapter behind a port."""

from pathlib import Path
from typing import Any, ClassVar

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from drivers.discovery.gauges import FoundGauge, search_port
from drivers.errors import GaugeSilent
from drivers.gauges.mux10 import Mux10Gauge
from drivers.gauges.protocol import Probe
from drivers.interfaces import DeviceIdentity, GaugeReading
from drivers.serial import opening
from drivers.serial.opening import adapter_at, serial_ports
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings

RATE = 38400
ABSENT = "/dev/nowhere"


class AtOneRate:
    """A gauge that hears nothing at another baud rate than its own."""

    name, channel = "x", None
    asked: ClassVar[list[Any]]

    def __init__(self, settings: GaugeSettings, _ports: SharedSerialPorts) -> None:
        self._baudrate = settings.serial.get("baudrate")
        self.asked.append(self._baudrate)

    async def open(self) -> DeviceIdentity:
        if self._baudrate != RATE:
            raise GaugeSilent("does not answer")
        return DeviceIdentity("x", "mux10", "a multiplexer")

    async def read_once(self) -> GaugeReading:
        return GaugeReading(1.25, "01A+0001.250")

    async def read(self) -> GaugeReading:
        return await self.read_once()

    async def check(self) -> None: ...

    async def close(self) -> None: ...


async def test_a_multiplexer_is_asked_at_other_baud_rates_once_nothing_answers() -> None:
    class Gauge(AtOneRate):
        asked: ClassVar[list[Any]] = []
        probe: ClassVar[Probe | None] = Mux10Gauge.probe

    found = await search_port(ABSENT, {"mux10": Gauge})
    assert found.gauges == (
        FoundGauge("mux10", ABSENT, "a multiplexer", None, "01A+0001.250", "", baudrate=RATE),
    )
    assert Gauge.probe is not None
    rates = Gauge.probe.other_baud_rates
    assert Gauge.asked == [None, *rates[: rates.index(RATE) + 1]]


async def test_other_protocols_are_asked_at_their_own_rate_alone() -> None:
    class Gauge(AtOneRate):
        asked: ClassVar[list[Any]] = []

    assert (await search_port(ABSENT, {"sylvac": Gauge})).gauges == ()
    assert Gauge.asked == [None]


@pytest.fixture
def plug(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Plugs adapters in: names of devices with serial number and USB socket."""
    by_id, by_path = tmp_path / "by-id", tmp_path / "by-path"
    monkeypatch.setattr(opening, "STABLE_NAMES", (by_id, by_path))

    def plugged(**devices: tuple[str | None, str]) -> None:
        infos = []
        for folder in (by_id, by_path):
            folder.mkdir(exist_ok=True)
            for link in folder.iterdir():
                link.unlink()
        for name, (number, socket) in devices.items():
            device = tmp_path / name
            device.touch()
            info = ListPortInfo(str(device))
            info.vid, info.pid, info.serial_number, info.location = 0x0403, 0x6001, number, socket
            info.hwid = "USB VID:PID"
            infos.append(info)
            (by_path / f"usb-{socket}").symlink_to(device)
            link = by_id / f"usb-{number}"
            link.unlink(missing_ok=True)  # the one that came last has it, as udev does
            link.symlink_to(device)
        monkeypatch.setattr(list_ports, "comports", lambda: infos)

    return plugged


def test_adapters_with_serial_numbers_are_named_by_these(plug, tmp_path: Path) -> None:
    plug(ttyUSB0=("A1", "1-1"), ttyUSB1=("A2", "1-2"))
    found = serial_ports()
    assert [Path(port.port).name for port in found] == ["usb-A1", "usb-A2"]
    assert found[1].adapter == "USB 0403:6001 serial number A2"
    assert adapter_at(str(tmp_path / "by-id" / "usb-A2")) == found[1].adapter


@pytest.mark.parametrize("number", [None, "0001"])
def test_adapters_that_cannot_be_told_apart_are_named_by_their_socket(plug, number) -> None:
    plug(ttyUSB0=(number, "1-1"), ttyUSB1=(number, "1-2"))
    assert [Path(port.port).name for port in serial_ports()] == ["usb-1-1", "usb-1-2"]


def test_adapters_plugged_in_again_in_another_order_are_others(plug, tmp_path: Path) -> None:
    plug(ttyUSB0=(None, "1-1"), ttyUSB1=(None, "1-2"))
    before = adapter_at(str(tmp_path / "ttyUSB0"))
    plug(ttyUSB1=(None, "1-1"), ttyUSB0=(None, "1-2"))
    assert adapter_at(str(tmp_path / "ttyUSB0")) != before
    assert adapter_at(str(tmp_path / "ttyUSB1")) == before


@pytest.mark.parametrize("port", ["socket://127.0.0.1:4001", "rfc2217://host:4001", "/dev/pts/77"])
def test_a_port_without_an_adapter_has_none(plug, port) -> None:
    plug(ttyUSB0=("A1", "1-1"))
    assert adapter_at(port) == ""


def test_a_port_of_the_board_has_a_name_only(plug, tmp_path: Path, monkeypatch) -> None:
    board, ghost = ListPortInfo(str(tmp_path / "ttyS0")), ListPortInfo(str(tmp_path / "ttyS1"))
    board.hwid = "PNP0501"
    monkeypatch.setattr(list_ports, "comports", lambda: [board, ghost])
    [found] = serial_ports()
    assert (found.port, found.adapter) == (str(tmp_path / "ttyS0"), "")
