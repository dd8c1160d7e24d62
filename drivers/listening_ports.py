"""Which ports of this computer accept connections from the network, by the kernel's tables."""

from __future__ import annotations

import ipaddress
import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

_TABLES = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
_LISTENING = "0A"


def accepts_from_network(port: int, tables: Sequence[Path] = _TABLES) -> bool:
    """Whether something listens at ``port`` beyond the loopback addresses; False if that is not known."""
    return any(not address.is_loopback for address in _listening_at(port, tables))


def is_loopback(host: str) -> bool:
    """Whether a network name or address is this computer's own."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _listening_at(
    port: int, tables: Sequence[Path]
) -> Iterator[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    for table in tables:
        with suppress(OSError, ValueError, LookupError):
            for line in table.read_text(encoding="ascii").splitlines()[1:]:
                _, local, _, state = line.split()[:4]
                address, _, own_port = local.partition(":")
                if state == _LISTENING and int(own_port, 16) == port:
                    # As the kernel writes it: words of four bytes, each in the computer's own order.
                    words = [int(address[start : start + 8], 16) for start in range(0, len(address), 8)]
                    yield ipaddress.ip_address(struct.pack(f"={len(words)}I", *words))
