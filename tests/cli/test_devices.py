"""``hexacell devices``: on an empty machine, with every protocol on pseudo-terminals, watching one."""

import io
import os
import re
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from drivers.discovery import SearchTimeouts
from drivers.simulated.encoders.bank import SimulatedDbcBank
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from hexacell.cell.described_devices import DbcSettings, StreamSettings, VisaSettings
from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings
from hexacell.cell.loader import load_cell
from hexacell.cell.simulation import SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import ExitCode
from hexacell.services.devices import device_diagnosis
from hexacell.services.devices.device_search import search_devices
from tests.cli.terminal import ended, start_at
from tests.drivers.encoders.dbc.conftest import SIGNALS, dbc_text

pytestmark = pytest.mark.usefixtures("lines_only", "no_ports")

CELL = "simulated-hexaglide.toml"
NO_BUS = "interface=virtual,channel=x"
NOBODY = "127.0.0.1:1"
"""A port where no server listens."""


@pytest.fixture
def addresses(served_cell: Path):
    """Where its devices are: the gauges' ports, the CAN adapter, and the controller."""
    settings = tomllib.loads(served_cell.read_text())
    controller = settings["controller"]
    return (
        [gauge["port"] for gauge in settings["gauges"]],
        settings["encoders"]["bus"]["channel"],
        f"{controller['host']}:{controller['port']}",
    )


@pytest.fixture
def no_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(list_ports, "comports", list)
    monkeypatch.setattr("drivers.discovery.encoders.NETWORK_DEVICES", Path("/nowhere"))


@pytest.fixture
def search_timeouts(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Has the search wait for so long."""

    def wait(**seconds: float) -> None:
        limited = partial(search_devices, timeouts=SearchTimeouts(**{"restart": 0.0} | seconds))
        monkeypatch.setattr("hexacell.cli.commands.devices.search_devices", limited)

    return wait


@pytest.fixture
def patient(search_timeouts: Callable[..., None]) -> None:
    """Simulated instruments share a busy machine with other tests; real ones answer at once."""
    search_timeouts(gauge=1.0, node=2.0, adapter=30.0, controller=10.0)


@pytest.fixture
def hasty(search_timeouts: Callable[..., None]) -> None:
    """No answer is expected: there is nothing to wait for."""
    search_timeouts(gauge=0.1, adapter=0.1)


def test_a_machine_without_devices_is_told_what_to_plug_in(typed_here) -> None:
    outcome = typed_here("devices", "--controller", NOBODY)
    assert (outcome.code, outcome.err) == (0, "")
    assert "No serial port: plug a gauge's cable" in outcome.out
    assert "No CAN adapter: plug it in" in outcome.out
    assert "No controller: LinuxCNC answers if" in outcome.out
    assert "For your cell file" not in outcome.out


@pytest.mark.usefixtures("patient")
def test_an_instrument_of_each_protocol_that_is_tried_is_found(typed_here) -> None:
    """Also after it was asked in the others, whose questions may not end for it."""
    protocols = ["cdi", "digimatic-usb", "heidenhain-nd", "mitutoyo-id-h", "mux10", "sylvac", "uwave"]
    gauges = [GaugeSettings(name=name, axis="x", protocol=name, channel=1) for name in protocols]
    plungers = {name: lambda: 1.25 for name in protocols}
    with SimulatedGaugeBank(gauges, plungers, SimulatedGauges(), CellClock(1.0)) as bank:
        outcome = typed_here(
            "devices", *[gauge.port for gauge in bank.gauges], "--controller", NOBODY, "--json"
        )
    assert outcome.code == 0, outcome.err
    found = [[one["protocol"] for one in port["gauges"]] for port in outcome.document["gauges"]]
    assert found == [[protocol] for protocol in protocols]
    assert "Not tried" not in outcome.err


@pytest.fixture
def streams() -> Iterator[SimulatedGaugeBank]:
    """Two U-WAVE transmitters behind one receiver, and a gauge that the cell file would describe."""
    described = StreamSettings(answer=r"([+-]\d+\.\d{2}) mm", example="+01.23 mm\r\n")
    gauges = [
        GaugeSettings(name="x", axis="x", protocol="uwave", channel=0),
        GaugeSettings(name="y", axis="y", protocol="uwave", channel=203),
        GaugeSettings(name="z", axis="z", protocol="stream", stream=described),
    ]
    plungers = {gauge.name: lambda: 1.25 for gauge in gauges}
    with SimulatedGaugeBank(gauges, plungers, SimulatedGauges(), CellClock(1.0)) as bank:
        yield bank


@pytest.mark.usefixtures("hasty")
def test_gauges_that_send_unasked_are_heard(typed_here, streams) -> None:
    ports = [streams.gauges[0].port, streams.gauges[2].port]
    outcome = typed_here("devices", *ports, "--controller", NOBODY, "--json")
    assert outcome.code == 0, outcome.err
    told = tomllib.loads(outcome.document["cell"])["gauges"]
    assert [(gauge["protocol"], gauge["channel"]) for gauge in told] == [("uwave", 0), ("uwave", 203)]
    assert [gauge["resolution_mm"] for gauge in told] == [0.001, 0.001]
    said = " ".join(outcome.err.split())
    assert "channel 203: uwave: Mitutoyo U-WAVE, shows DT10203+0000001.250M" in said
    assert "sends '+01.25 mm' by itself at 9600 baud" in said
    assert 'protocol = "stream" (docs/drivers.md)' in said


def test_encoders_of_another_kind_are_told_by_their_frames(typed_here, tmp_path) -> None:
    (tmp_path / "encoders.dbc").write_text(dbc_text())
    described = DbcSettings(file=str(tmp_path / "encoders.dbc"), signals=SIGNALS)
    settings = LinearEncoderSettings(protocol="dbc", measuring_step_nm=500, dbc=described)
    with SimulatedDbcBank(settings, described, lambda: [12.5] * 6) as bank:
        bus = f"interface=virtual,channel={bank.channel}"
        outcome = typed_here("devices", "--can", bus, "--controller", NOBODY, "--json")
    assert outcome.code == 0, outcome.err
    said = " ".join(outcome.err.split())
    assert "no CANopen node answers, but there are frames" in said
    assert re.search(r"frame 201: 6 bytes, [1-9]\d* a second, its data stay the same", said)
    assert 'protocol = "dbc" (docs/drivers.md)' in said
    told = tomllib.loads(outcome.document["cell"])["encoders"]
    told["bus"] = dict(told["bus"])
    assert LinearEncoderSettings.model_validate(told).dbc is not None
    assert "among 201, 202, 203, 204, 205, 206" in outcome.document["cell"]


def test_an_instrument_with_visa_is_asked_its_name(typed_here) -> None:
    gauge = GaugeSettings(name="x", axis="x", protocol="visa", visa=VisaSettings(ask="MEAS:DIST?"))
    simulated = SimulatedGauges(transport="socket")
    with SimulatedGaugeBank([gauge], {"x": lambda: 1.25}, simulated, CellClock(1.0)) as bank:
        [at] = [one.port for one in bank.gauges]
        outcome = typed_here("devices", at, "--controller", NOBODY)
    assert outcome.code == 0, outcome.err
    said = " ".join(outcome.out.split())
    assert f"{at}: is HEXACELL,SIMULATED,0,1. Say what it is asked with protocol" in said


@pytest.mark.usefixtures("hasty")
def test_ports_of_nothing_and_of_nobody_are_told(typed_here, tmp_path) -> None:
    near, far = os.openpty()
    name = os.ttyname(far)
    outcome = typed_here("devices", name, tmp_path / "gone", "--controller", NOBODY)
    os.close(near)
    os.close(far)
    assert outcome.code == 0
    said = " ".join(outcome.out.split())
    assert f"{name}: nothing answers; is the gauge on, and is its cable a duplex one?" in said
    assert f"{tmp_path / 'gone'}: port {tmp_path / 'gone'} is absent" in said
    assert "Not tried where nothing answers: keyence-dl-rs1a, modbus, request, visa, which" in said


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("--can", "slcan"), 2, "--can slcan does not say what the bus is"),
        (("--controller", "robot"), 2, "--controller robot is not an address"),
        (("--controller", "127.0.0.1:99999"), 2, "--controller 127.0.0.1:99999 is not an address"),
        (("--diagnose", "x"), 2, "--diagnose wants the cell"),
        (("--diagnose", "x", "--seconds", "nan"), 2, "argument --seconds"),
        (("--diagnose", "w", "--cell", CELL), 2, "no device 'w'. Name one of x, y, z, encoders"),
        (("--can", NO_BUS, "--set-node", "9"), 4, "Start it at a terminal"),
        (("--set-node", "9"), 2, "--set-node wants one bus"),
        (("--can", NO_BUS, "--set-node", "128"), 2, "--set-node"),
        (("--write", CELL), 2, "is there already"),
        (("--write", "nowhere/new.toml"), 2, "no file can be made there"),
        (("--write", f"{CELL}/new.toml"), 2, "no file can be made there"),
        (("--write", "new.toml"), 4, "asks what no device reports"),
    ],
)
def test_what_cannot_be_is_refused(typed_here, cell_folder, monkeypatch, arguments, code, told) -> None:
    monkeypatch.setattr("hexacell.cli.commands.devices.is_interactive", lambda: False)
    monkeypatch.chdir(cell_folder.path)
    refused = typed_here("devices", *arguments)
    assert (refused.code, refused.out, told in refused.err) == (code, "", True)


@pytest.mark.parametrize(("device", "rows"), [("x", 1), ("encoders", 6)])
def test_one_device_is_watched(typed_here, served_cell, device, rows) -> None:
    outcome = typed_here(
        "devices", "--diagnose", device, "--cell", served_cell, "--seconds", "0.3", "--json"
    )
    assert outcome.code == 0, outcome.err
    found = outcome.document
    assert found["readings"] > 0
    assert len(found["series"]) == rows
    assert all(series["lowest"] <= series["highest"] for series in found["series"])
    assert found["failures"] == []
    assert "No answer was damaged or missing." in outcome.err
    assert "It can be used." in outcome.err


@pytest.mark.parametrize(
    ("fault", "kind", "meaning"),
    [
        ("damaged", "damaged or foreign", "Answers are damaged: check its cable"),
        ("at its end", "at an end of the travel", "Its plunger is at an end of its travel"),
    ],
)
def test_what_comes_instead_of_readings_is_counted_by_kind(
    typed_here, cell_folder, monkeypatch, fault, kind, meaning
) -> None:
    """Of as many readings on any machine: twenty a second by this clock."""
    clock = SimpleNamespace(monotonic=partial(next, count(0.0, 0.05)))
    monkeypatch.setattr(device_diagnosis, "time", clock)
    with cell_folder.cell.open("a") as cell:
        cell.write(f'\n[[simulation.faults]]\nkind = "{fault}"\ndevice = "x"\n')
    outcome = typed_here(
        "devices", "--diagnose", "x", "--cell", cell_folder.cell, "--seconds", "1", "--json"
    )
    [failure] = outcome.document["failures"]
    assert failure["kind"] == kind
    said = " ".join(outcome.err.split())
    assert f"{failure['count']} answers were {kind}, at last: " in said
    assert meaning in said


@pytest.mark.usefixtures("patient")
def test_a_cell_file_is_written_from_what_was_found_and_answers(
    typed_here, cell_folder, monkeypatch, addresses
) -> None:
    """Only its name is typed: all else is suggested. That every protocol is tried is tested above."""
    tried = ["cdi", "mux10", "sylvac"]
    monkeypatch.setattr("hexacell.services.devices.device_search.names", lambda _group: tried)
    gauges, adapter, controller = addresses
    monkeypatch.setattr("hexacell.cli.commands.devices.is_interactive", lambda: True)
    monkeypatch.setattr("sys.stdin", io.StringIO("press 3\n" + 30 * "\n"))
    outcome = typed_here(
        "devices", *gauges, adapter, "--controller", controller, "--write", "cell/new.toml"
    )
    assert outcome.code == 0, outcome.err
    said = " ".join(outcome.out.split())
    for words in ("sylvac: SY276, shows", "channel 1: mux10: MUX-10F", "a CAN adapter", "HELLO ACK"):
        assert words in said
    written = load_cell(cell_folder.path / "new.toml").settings
    assert written.name == "press 3"
    assert [gauge.port for gauge in written.gauges] == gauges
    assert [gauge.resolution_mm for gauge in written.gauges] == [0.001, 0.001, 0.0001]
    assert written.encoders.serial_numbers == tuple(range(1001, 1007))
    assert f"{written.controller.host}:{written.controller.port}" == controller


def test_a_node_id_is_set_for_the_only_device_alone(start, terminal, addresses) -> None:
    """The six encoders of the cell are all on this bus."""
    _, adapter, _ = addresses
    bus = f"interface=slcan,channel={adapter},sleep_after_open=0"
    process = start_at(terminal, start, "devices", "--can", bus, "--set-node", "9")
    terminal.read_until("Type yes: ")
    terminal.type("yes\n")
    assert ended(process, terminal) == ExitCode.HARDWARE
    told = " ".join(terminal.shown.split())
    assert "has several nodes: 1, 2, 3, 4, 5, 6. Connect the one device" in told
