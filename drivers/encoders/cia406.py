"""CANopen encoders (CiA 406), sampled simultaneously: one SYNC, a position of each."""

import threading
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from drivers.encoders import node_identity
from drivers.encoders.bank import BankSession, ThreadedBank, bus_settings
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg, explained
from drivers.encoders.node_monitor import AlarmPoll, AlarmTiming, NodeMonitor, check_nodes
from drivers.encoders.object_dictionary import DeviceType, NmtCommand
from drivers.encoders.sync_sampling import SyncSampler, configure_position_tpdo, follow_plain_sync
from drivers.errors import SilentNodeError
from drivers.interfaces import DeviceIdentity
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import EncoderSettings


class EncoderSession(BankSession):
    """Opens, identifies, configures and starts the nodes; then takes samples."""

    alarm_timing: ClassVar[AlarmTiming] = AlarmTiming()

    def __init__(
        self, settings: EncoderSettings, closing: threading.Event, trace: TraceRecorder | None
    ) -> None:
        self._legs = tuple(Leg(number, node) for number, node in enumerate(settings.nodes, 1))
        super().__init__(settings, [leg.subject for leg in self._legs])
        self._monitors: tuple[NodeMonitor, ...] = ()
        self._data_sheet = (
            None if settings.eds is None else node_identity.read_data_sheet(Path(settings.eds))
        )
        self.bus = EncoderBus(bus_settings(settings), closing, trace)
        self.close = self.bus.close

    def _sample(self) -> tuple[int, ...]:
        """The counts of one SYNC; valid only if no fault is found after it."""
        try:
            self.bus.check()
            self._alarms.begin_sample()
            counts = self._sampler.sample()
            self._alarms.check()
            self.bus.check()
        except SilentNodeError as error:
            raise explained(error, self._nodes, self.bus) from error
        return counts

    def start(self) -> None:
        """Configure all nodes, and start them together."""
        self._nodes = tuple(EncoderNode(leg, self.bus, self._settings.timeout_s) for leg in self._legs)
        try:
            self._start()
        except SilentNodeError as error:
            resting = [monitor.leg for monitor in self._monitors if monitor.is_resting]
            raise explained(error, self._nodes, self.bus, resting) from error

    def _start(self) -> None:
        settings, legs, nodes = self._settings, self._legs, self._nodes
        for node in nodes:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        node_identity.detect_nodes(nodes, self.bus, settings.timeout_s)
        self._monitors = monitors = tuple(NodeMonitor(leg, self.bus, settings.heartbeat_ms) for leg in legs)
        device_types = tuple(node_identity.read_device_type(node, settings.unit) for node in nodes)
        self.identities = tuple(map(self._identify, nodes, device_types, monitors))
        channels = tuple(
            configure_position_tpdo(node, device_type)
            for node, device_type in zip(nodes, device_types, strict=True)
        )
        sampler = SyncSampler(legs, channels, self.bus, settings.timeout_s, signed=settings.signed)

        def check_all() -> None:
            for node in nodes:
                node.check_alone()
            check_nodes(monitors)
            sampler.check()

        self._sampler = sampler
        self.bus.health_check = check_all
        self._alarms = AlarmPoll(nodes, monitors, self.alarm_timing)
        for node in nodes:
            node.command(NmtCommand.START)
        sampler.sample()
        self.bus.listen(node_identity.SECOND_RESPONSE_S)  # to surplus responses

    def _identify(self, node: EncoderNode, device_type: DeviceType, monitor: NodeMonitor) -> DeviceIdentity:
        node_identity.check_step(node, self._settings)
        identity = node_identity.read_identity(node, device_type)
        node_identity.check_serial_number(node, identity, self._settings)
        differing = "" if self._data_sheet is None else self._data_sheet.check(node)
        follow_plain_sync(node)
        remarks = (identity.remark, differing, monitor.start_heartbeat(node))
        return replace(identity, remark="; ".join(filter(None, remarks)))


class Cia406Bank(ThreadedBank[EncoderSession]):
    """The encoder bank of a cell; implements :class:`drivers.interfaces.EncoderBank`.

    ``settings.bus`` is passed unchanged to ``can.Bus``, so every interface of python-can works.
    """

    session = EncoderSession
