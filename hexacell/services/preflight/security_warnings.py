"""What makes it easy for others to move the robot or to read its passwords; a run goes on all the same."""

from __future__ import annotations

from collections.abc import Iterator
from urllib.parse import urlsplit

from drivers.listening_ports import accepts_from_network, is_loopback
from hexacell.cell.loader import Cell
from hexacell.cell.operation import scheme_of

IN_CLEAR = ("http", "mqtt")


def telling_warnings(cell: Cell) -> Iterator[str]:
    """Notifications whose password crosses a network in clear."""
    for one in cell.settings.notifications:
        host = None if one.url is None else urlsplit(one.url).hostname
        if host is None or one.url is None or scheme_of(one.url) not in IN_CLEAR or is_loopback(host):
            continue
        if one.password_file is not None:
            scheme = scheme_of(one.url)
            yield (
                f"notification {one.name}: its password goes over the network in clear. Write {scheme}s:// "
                f"instead of {scheme}://"
            )


def exposure_warnings(cell: Cell) -> Iterator[str]:
    """A controller that others may reach: across a network, or on a port that is open to it."""
    controller = cell.settings.controller
    if cell.settings.simulation is not None or controller.port is None:
        return
    where = f"controller {controller.host}:{controller.port}"
    if not is_loopback(controller.host):
        yield (
            f"{where}: passwords and commands go there over the network in clear, and whoever reaches that "
            "port may move the robot. Keep it in a network of its own, or use a tunnel to 127.0.0.1"
        )
    elif accepts_from_network(controller.port):
        yield (
            f"{where}: it accepts connections from the network too, and whoever reaches that port may move "
            "the robot. Let it listen on 127.0.0.1 alone, or close the port in the firewall"
        )
