"""What is told of a cell's computer: ports that the network reaches, late adapters, passing names."""

import socket
from dataclasses import replace
from pathlib import Path

import pytest

from hexacell.cell.loader import load_cell
from hexacell.services.preflight import accepts_from_network, is_loopback, port_warnings

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
