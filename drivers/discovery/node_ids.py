"""The node id of one CANopen device is set, by LSS (CiA 305): of an encoder that comes with another one.

All devices in LSS configuration state take the same id. So the device must be alone on the bus, and devices
are counted before anything is set.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from contextlib import closing
from typing import Any

from canopen.lss import CS_INQUIRE_VENDOR_ID, LssError, LssMaster

from drivers.discovery import USUAL, SearchTimeouts
from drivers.discovery.encoders import responding_nodes
from drivers.encoders.can_bus import EncoderBus
from drivers.errors import BusError
from hexacell.errors import DeviceError

RESPONSES = 0x7E4
SECOND_RESPONSE_S = 0.1
"""How long a second device may take to answer the same question."""

_NMT, _RESET_COMMUNICATION = 0x000, bytes((0x82, 0))
ALONE = "Connect the one device whose node id is to be set, and no other"


def set_node_id(bus: Mapping[str, Any], node: int, timeouts: SearchTimeouts = USUAL) -> int | None:
    """Have the only device on a bus take a node id, and keep it; the id that it had, if it had one.

    Args:
        bus: settings for ``can.Bus``.
        node: from 1 to 127.
        timeouts: longest waits.

    Raises:
        BusError: the bus cannot be opened, or has failed; or nothing has the id afterwards.
        DeviceError: there is no device, or more than one; it does not know LSS, or refuses the id.
    """
    with closing(EncoderBus(bus, threading.Event())) as opened:
        before = responding_nodes(opened, timeouts)
        if len(before) > 1:
            nodes = ", ".join(map(str, before))
            raise DeviceError(f"has several nodes: {nodes}", subject=opened.name, action=ALONE)
        master = opened.network.lss
        master.send_switch_state_global(master.CONFIGURATION_STATE)  # type: ignore[no-untyped-call]
        try:
            _require_alone(opened, master)
            master.configure_node_id(node)  # type: ignore[no-untyped-call]
            master.store_configuration()  # type: ignore[no-untyped-call]
        except LssError as error:
            raise DeviceError(
                f"has a device that refuses node id {node}: {error}",
                subject=opened.name,
                action="Set it with its vendor's tool",
            ) from error
        finally:
            master.send_switch_state_global(master.WAITING_STATE)  # type: ignore[no-untyped-call]
        opened.network.send_message(_NMT, _RESET_COMMUNICATION)
        opened.network.scanner.reset()  # type: ignore[no-untyped-call]
        if node not in responding_nodes(opened, timeouts):
            raise BusError(
                f"has no node {node} after it was stored",
                subject=opened.name,
                action="Switch the device off and on, and look: hexacell devices --can",
            )
        return before[0] if before else None


def _require_alone(bus: EncoderBus, master: LssMaster) -> None:
    """Also a device without a node id, which no search finds, answers what its vendor is."""
    answers: list[int] = []
    bus.network.subscribe(RESPONSES, lambda *_frame: answers.append(1))
    try:
        master.inquire_lss_address(CS_INQUIRE_VENDOR_ID)  # type: ignore[no-untyped-call]
    except LssError as error:
        raise DeviceError(
            f"has no device that knows LSS: {error}",
            subject=bus.name,
            action="Check supply, cable and bit rate, or set its node id with its vendor's tool",
        ) from error
    bus.listen(SECOND_RESPONSE_S)
    if len(answers) > 1:
        raise DeviceError(f"has {len(answers)} devices that answer", subject=bus.name, action=ALONE)
