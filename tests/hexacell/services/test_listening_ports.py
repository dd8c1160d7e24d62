"""A server that the network can reach is told from one that only this computer can."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hexacell.services.preflight import accepts_from_network, is_loopback

needs_tables = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="no tables of this kernel")


@contextmanager
def listening(host: str, family: socket.AddressFamily = socket.AF_INET) -> Iterator[int]:
    with socket.socket(family) as server:
        server.bind((host, 0))
        server.listen()
        yield server.getsockname()[1]


@needs_tables
@pytest.mark.parametrize(("host", "reachable"), [("127.0.0.1", False), ("0.0.0.0", True)])
def test_a_server_for_all_addresses_is_found(host: str, reachable: bool) -> None:
    with listening(host) as port:
        assert accepts_from_network(port) is reachable
    assert not accepts_from_network(port)


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


@pytest.mark.parametrize(
    ("host", "own"),
    [("127.0.0.1", True), ("::1", True), ("LocalHost", True), ("192.168.1.7", False), ("robot", False)],
)
def test_names_of_this_computer(host: str, own: bool) -> None:
    assert is_loopback(host) is own
