"""Six CANopen encoders (CiA 406), sampled simultaneously: one SYNC, six positions."""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import partial
from pathlib import Path

from drivers.encoders.bank import SampleHistory, ThreadedBank, bus_settings, joint_variables
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg, NmtCommand
from drivers.encoders.electronic_data_sheet import read_data_sheet
from drivers.encoders.node_identity import (
    check_serial_number,
    check_step,
    detect_nodes,
    read_device_type,
    read_identity,
    switch_sync_counter_off,
)
from drivers.encoders.node_monitor import AlarmPoll, NodeMonitor, check_nodes
from drivers.encoders.object_dictionary import DeviceType
from drivers.encoders.sync_sampling import SyncSampler, configure_position_tpdo
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import EncoderSettings


class Cia406Bank(ThreadedBank["EncoderSession"]):
    """The encoder bank of a cell; implements :class:`drivers.interfaces.EncoderBank`.

    ``settings.bus`` is passed unchanged to ``can.Bus``, so every interface of python-can works.
    ``trace`` is called with every CANopen frame, from the threads of the bus. Every failure is a
    ``DeviceError``, those with a reaction of their own one of :mod:`drivers.errors`.
    """

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        super().__init__()
        self._settings = settings
        self._trace = trace

    def _begin(self, closing: threading.Event) -> EncoderSession:
        return EncoderSession(self._settings, closing, self._trace)


class EncoderSession:
    """Opens, identifies, configures and starts the nodes; then takes samples.

    Used by one thread. If a step fails, the bus is closed again.
    """

    identities: tuple[DeviceIdentity, ...]
    """Legs 1 to 6."""

    def __init__(
        self, settings: EncoderSettings, closing: threading.Event, trace: TraceRecorder | None = None
    ) -> None:
        self.bus = EncoderBus(bus_settings(settings), closing, trace)
        self._settings = settings
        self._legs = tuple(Leg(number, node) for number, node in enumerate(settings.nodes, 1))
        self._history = SampleHistory(settings, [leg.subject for leg in self._legs])
        try:
            self._data_sheet = None if settings.eds is None else read_data_sheet(Path(settings.eds))
            self._start()
        except BaseException:
            self.bus.close()
            raise

    def read(self) -> EncoderSample:
        """One complete sample; valid only if no fault is found after it."""
        self.bus.check()
        self._alarms.begin_sample()
        counts = self._sampler.sample()
        self._alarms.check()
        self.bus.check()
        self._history.check_signs(counts)
        positions = joint_variables(counts, self._settings)
        self._history.check_speed(positions)
        return EncoderSample(counts, positions, self._settings.unit)

    def close(self) -> None:
        """Close the bus."""
        self.bus.close()

    def _start(self) -> None:
        settings = self._settings
        legs = self._legs
        nodes = tuple(EncoderNode(leg, self.bus, settings.timeout_s) for leg in legs)
        for node in nodes:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        detect_nodes(nodes, self.bus, settings.timeout_s)
        monitors = tuple(NodeMonitor(leg, self.bus, settings.heartbeat_ms) for leg in legs)
        device_types = tuple(read_device_type(node, settings.unit) for node in nodes)
        self.identities = tuple(map(self._identify, nodes, device_types))
        channels = tuple(
            configure_position_tpdo(node, device_type, settings.heartbeat_ms)
            for node, device_type in zip(nodes, device_types, strict=True)
        )
        for monitor in monitors:
            monitor.start_heartbeat_timeout()
        self._sampler = SyncSampler(legs, channels, self.bus, settings.timeout_s, signed=settings.signed)
        self.bus.health_check = partial(_check_all, nodes, monitors, self._sampler)
        self._alarms = AlarmPoll(nodes, monitors)
        for node in nodes:
            node.command(NmtCommand.START)
        self._sampler.self_test()

    def _identify(self, node: EncoderNode, device_type: DeviceType) -> DeviceIdentity:
        check_step(node, self._settings)
        identity = read_identity(node, device_type)
        check_serial_number(node, identity, self._settings)
        if self._data_sheet is not None and (differing := self._data_sheet.check(node)):
            identity = replace(identity, remark="; ".join(filter(None, (identity.remark, differing))))
        switch_sync_counter_off(node)
        return identity


def _check_all(
    nodes: tuple[EncoderNode, ...], monitors: tuple[NodeMonitor, ...], sampler: SyncSampler
) -> None:
    for node in nodes:
        node.check_alone()
    check_nodes(monitors)
    sampler.check()
