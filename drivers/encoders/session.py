"""An open encoder bank, as used by its worker thread."""

from __future__ import annotations

import threading
from functools import partial

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg, NmtCommand
from drivers.encoders.node_identity import (
    check_measuring_step,
    check_serial_number,
    detect_nodes,
    read_device_type,
    read_identity,
)
from drivers.encoders.node_monitor import AlarmPoll, NodeMonitor, check_nodes
from drivers.encoders.object_dictionary import DeviceType
from drivers.encoders.pdo_configuration import configure_position_tpdo
from drivers.encoders.sync_sampling import SyncSampler
from drivers.errors import BusError
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import EncoderSettings

NM_TO_MM = 1e-6


class EncoderSession:
    """Opens, identifies, configures and starts the nodes; then takes samples.

    Raises:
        DeviceError: A step failed; the bus is closed again.
    """

    def __init__(
        self, settings: EncoderSettings, interrupted: threading.Event, trace: TraceRecorder | None = None
    ) -> None:
        self._settings = settings
        self._bus = EncoderBus(_bus_settings(settings), interrupted, trace)
        try:
            self._start()
        except BaseException:
            self._bus.close()
            raise

    @property
    def identities(self) -> tuple[DeviceIdentity, ...]:
        """The identities, legs 1 to 6."""
        return self._identities

    def read(self) -> EncoderSample:
        """One complete sample; valid only if no fault is found after it.

        Raises:
            DeviceError: The fault.
        """
        self._bus.check()
        counts = self._sampler.sample(signed=self._settings.signed)
        self._alarms.check()
        self._bus.check()
        return EncoderSample(counts, positions_mm(counts, self._settings))

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _start(self) -> None:
        settings = self._settings
        legs = tuple(Leg(number, node) for number, node in enumerate(settings.nodes, 1))
        nodes = tuple(EncoderNode(leg, self._bus, settings.timeout_s) for leg in legs)
        for node in nodes:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        detect_nodes(nodes, self._bus, settings.timeout_s)
        monitors = tuple(NodeMonitor(leg, self._bus, settings.heartbeat_ms) for leg in legs)
        device_types = tuple(read_device_type(node) for node in nodes)
        self._identities = tuple(map(self._identify, nodes, device_types))
        channels = tuple(
            configure_position_tpdo(node, device_type, settings.heartbeat_ms)
            for node, device_type in zip(nodes, device_types, strict=True)
        )
        for monitor in monitors:
            monitor.start_heartbeat_timeout()
        self._sampler = SyncSampler(legs, channels, self._bus, settings.timeout_s)
        self._bus.health_check = partial(_check_all, nodes, monitors, self._sampler)
        self._alarms = AlarmPoll(nodes, monitors)
        for node in nodes:
            node.command(NmtCommand.START)
        self._sampler.self_test(signed=settings.signed)

    def _identify(self, node: EncoderNode, device_type: DeviceType) -> DeviceIdentity:
        check_measuring_step(node, self._settings.measuring_step_nm)
        identity = read_identity(node, device_type)
        check_serial_number(node, identity, self._settings)
        return identity


def positions_mm(counts: tuple[int, ...], settings: EncoderSettings) -> tuple[float, ...]:
    """Joint variables q along the rails, mm: direction x counts x step + offset."""
    step_mm = settings.measuring_step_nm * NM_TO_MM
    terms = zip(settings.direction, counts, settings.offset_mm, strict=True)
    return tuple(direction * count * step_mm + offset for direction, count, offset in terms)


def _check_all(
    nodes: tuple[EncoderNode, ...], monitors: tuple[NodeMonitor, ...], sampler: SyncSampler
) -> None:
    for node in nodes:
        node.check_alone()
    check_nodes(monitors)
    sampler.check()


def _bus_settings(settings: EncoderSettings) -> dict[str, object]:
    if settings.bus is None:
        raise BusError(
            "is not configured in the cell file",
            subject="encoder bus",
            action="State `bus` under [encoders], for example "
            '{ interface = "slcan", channel = "/dev/ttyACM0", bitrate = 500000 }',
        )
    return settings.bus
