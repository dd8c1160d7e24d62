"""What nodes say of themselves unasked: boot-ups, heartbeats and emergencies (CiA 301).

Errors that a device keeps in its dictionary: 1001h and 6503h, looked at now and then.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from canopen.emcy import EmcyError

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode
from drivers.encoders.errors import InvalidSampleError, Leg, RestartedNodeError, SilentNodeError
from drivers.encoders.object_dictionary import ALARMS, ERROR_REGISTER, ObjectEntry

HEARTBEAT = 0x700
EMERGENCY = 0x080

MAX_MISSED_HEARTBEATS = 3
"""So many in a row are a loss."""
JITTER_S = 0.2
"""What a PC may be late by in looking."""

_KNOWN_EMERGENCIES = {0xFF00: "no magnet", 0x8130: "its heartbeat monitoring tripped"}


class NodeState(IntEnum):
    """What a heartbeat carries; a boot-up message is the one with 0."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class NodeMonitor:
    """Follows one node from the moment that it is about to be configured.

    ``restarted`` stays set once the node has booted or left OPERATIONAL. ``emergency`` is the
    error, in words, that the node has reported and not taken back; ``emergencies`` counts all
    that it ever reported.
    """

    def __init__(self, leg: Leg, bus: EncoderBus, heartbeat_ms: int) -> None:
        self.leg = leg
        self.restarted = False
        self.emergency: str | None = None
        self.emergencies = 0
        self.timeout_s = MAX_MISSED_HEARTBEATS * heartbeat_ms / 1000 + JITTER_S
        self._heartbeat_ms = heartbeat_ms
        self._heard: float | None = None
        self._was_operational = False
        self._news = bus.condition
        bus.network.subscribe(HEARTBEAT + leg.node, self._on_heartbeat)
        bus.network.subscribe(EMERGENCY + leg.node, self._on_emergency)

    @property
    def is_silent(self) -> bool:
        """Whether its heartbeat is overdue."""
        return self._heard is not None and time.monotonic() - self._heard > self.timeout_s

    def start_heartbeat_timeout(self) -> None:
        """From now on silence is a fault, unless heartbeats are off."""
        if self._heartbeat_ms:
            self._heard = time.monotonic()

    def _on_heartbeat(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        if self._heard is not None:
            self._heard = time.monotonic()
        state = data[0] & 0x7F if data else NodeState.BOOT_UP
        if state == NodeState.OPERATIONAL:
            self._was_operational = True
        elif state == NodeState.BOOT_UP or self._was_operational:
            self.restarted = True
            self._news.notify_all()

    def _on_emergency(self, _can_id: int, data: bytearray, timestamp: float) -> None:
        error = _unpack_emergency(data, timestamp)
        if error.code >> 8 == 0 and error.register == 0:
            self.emergency = None
            return
        self.emergencies += 1
        self.emergency = _in_words(error)
        self._news.notify_all()


def check_nodes(watches: Sequence[NodeMonitor]) -> None:
    """Raise if some node cannot be relied on.

    Raises:
        RestartedNodeError: It lost its configuration.
        SilentNodeError: Its heartbeat is overdue.
        InvalidSampleError: It reports an error that it has not taken back.
    """
    restarted = [watch.leg for watch in watches if watch.restarted]
    if restarted:
        raise _restarted(restarted)
    silent = [watch for watch in watches if watch.is_silent]
    if silent:
        raise _silent(silent, everybody=len(silent) == len(watches))
    for watch in watches:
        if watch.emergency is not None:
            raise invalid_sample(f"reports {watch.emergency}", watch.leg)


def invalid_sample(what: str, leg: Leg) -> InvalidSampleError:
    """The error for positions that the device itself does not vouch for."""
    return InvalidSampleError(
        f"{what}; its position cannot be trusted",
        leg,
        action="Remove the cause (magnet, distance, temperature), then measure again",
    )


def silence_action(*, everybody: bool) -> str:
    """Where to look when one leg is silent, or when all are."""
    where = "the CAN adapter, supply and termination" if everybody else "its supply and cable"
    return f"Check {where}, then open the encoders again; the set that was being measured is void"


def _restarted(legs: Sequence[Leg]) -> RestartedNodeError:
    return RestartedNodeError(
        "restarted, or was stopped, in the middle of the run and lost its configuration: the set is void",
        *legs,
        action="Check its supply, open the encoders again and repeat the set",
    )


def _silent(watches: Sequence[NodeMonitor], *, everybody: bool) -> SilentNodeError:
    return SilentNodeError(
        f"no heartbeat for {watches[0].timeout_s:.2g} s",
        *(watch.leg for watch in watches),
        action=silence_action(everybody=everybody),
    )


def _unpack_emergency(data: bytearray, timestamp: float) -> EmcyError:
    """Code, error register and the maker's five bytes; what is cut off counts as an error."""
    code, register, details = struct.unpack("<HB5s", bytes(data[:8]).ljust(8, b"\xff"))
    return EmcyError(code, register, details, timestamp)


def _in_words(error: EmcyError) -> str:
    known = _KNOWN_EMERGENCIES.get(error.code) or error.get_desc().lower()
    return f"emergency {error.code:04X} ({known}, error register {error.register:#04x})"


ALARM_POLL_S = 0.1
"""A device that raises an alarm without an emergency message is found out after so long."""

_COMMUNICATION = 0x10
"""Bit of the error register that says nothing about positions."""


@dataclass(frozen=True, slots=True)
class _Supported:
    node: EncoderNode
    entries: tuple[ObjectEntry, ...]


class AlarmPoll:
    """Reads the error entries of all nodes: at once, then every ``PERIOD_S`` and after emergencies.

    Raises:
        NodeError: As :meth:`check`.
    """

    def __init__(self, nodes: Sequence[EncoderNode], watches: Sequence[NodeMonitor]) -> None:
        self._watches = watches
        self._seen = -1
        self._due = 0.0
        self._supported = [
            _Supported(node, tuple(entry for entry in (ERROR_REGISTER, ALARMS) if _has(node, entry)))
            for node in nodes
        ]
        self.check()

    def check(self) -> None:
        """Look if it is time to.

        Raises:
            InvalidSampleError: A device has an alarm.
            NodeError: It does not answer.
        """
        emergencies = sum(watch.emergencies for watch in self._watches)
        if time.monotonic() < self._due and emergencies == self._seen:
            return
        for supported in self._supported:
            _check(supported)
        self._seen = emergencies
        self._due = time.monotonic() + ALARM_POLL_S


def _has(node: EncoderNode, entry: ObjectEntry) -> bool:
    return node.read_optional(entry) is not None


def _check(supported: _Supported) -> None:
    for entry in supported.entries:
        value = supported.node.read(entry)
        if entry is ERROR_REGISTER:
            value &= ~_COMMUNICATION
        if value:
            raise invalid_sample(f"has an alarm ({entry} is {value:#06x})", supported.node.leg)
