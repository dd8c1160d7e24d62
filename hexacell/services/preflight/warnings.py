"""Warnings before a run: expired certificates, and what lets others move the robot or read passwords."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from urllib.parse import urlsplit

from drivers.listening_ports import accepts_from_network, is_loopback
from hexacell.cell.loader import Cell
from hexacell.cell.operation import scheme_of

IN_CLEAR = ("http", "mqtt")


def certificate_warnings(cell: Cell) -> Iterator[str]:
    """One for each instrument whose certificate has expired today."""
    for name in cell.settings.expired_on(datetime.now(UTC).date()):
        due = cell.settings.certificates[name].due
        yield (
            f"the certificate of {name} expired on {due}: a person must approve what is found with it. "
            "Have it calibrated, and state its new certificate"
        )


def telling_warnings(cell: Cell) -> Iterator[str]:
    """Notifications whose password crosses a network in clear."""
    for one in cell.settings.notifications:
        if one.url is None or one.password_file is None:
            continue
        host, scheme = urlsplit(one.url).hostname, scheme_of(one.url)
        if host is not None and scheme in IN_CLEAR and not is_loopback(host):
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
