"""What makes it easy for others to move the robot or to read its passwords; a run goes on all the same."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.listening_ports import accepts_from_network, is_loopback
from hexacell.cell.loader import Cell


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
