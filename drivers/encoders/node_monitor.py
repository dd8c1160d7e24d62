"""Monitoring of the nodes: boot-up, heartbeat, emergency messages (CiA 301), and alarm entries."""

import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass

from canopen.emcy import EmcyError

from drivers.encoders import object_dictionary as od
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import EncoderNode, Leg, silent_nodes, subject_of
from drivers.errors import RestartedNodeError, invalid_sample

HEARTBEAT = 0x700
EMERGENCY = 0x080

BOOT_UP = 0x00
"""The NMT state in the heartbeat that announces a start."""
OPERATIONAL = 0x05
"""The NMT state in the heartbeats of a started node."""

_COMMUNICATION = 0x10
"""Bit of the error register for communication errors, which do not concern positions."""

MAX_MISSED_HEARTBEATS = 3
"""So many consecutive missing heartbeats are a failure."""
JITTER_S = 0.2
"""Scheduling delay that is tolerated on the PC."""

_KNOWN_EMERGENCIES = {
    0xFF00: "no magnet",
    0x8130: "its heartbeat monitoring tripped",
    0x8240: "it expects another length of SYNC",
}
_ACTIONS = {
    "2": "Check its cable for a short circuit, then measure again",
    "3": "Check the voltage of its supply at the encoder, then measure again",
    "4": "Let it cool, or warm up, and see what heats it; then measure again",
    **dict.fromkeys("56", "Switch it off and on, then try again; if it stays so, replace it"),
    "8": "Try again; if it stays so, set the node with its vendor's tool",
    "81": "Check cable, termination and bit rate of the bus, then try again",
    "8130": "Try again; if it stays so, switch its heartbeat consumer (1016h) off",
    "8150": "Give each device on the bus a node id of its own, then try again",
    **dict.fromkeys(("FF00", "m"), "Remove the cause (magnet, distance, dirt, heat), then measure again"),
    "b": "Change its battery, then try again",
    "o": "It is old: replace it soon; for now try again",
    "s": "State a lower speed in [speed], then measure again",
}
"""By how the code of an emergency begins (CiA 301, table of error codes), and by what bits mean."""
_BITS = {od.ERROR_REGISTER: "-234", od.ALARMS: "m", od.WARNINGS: "sm6ob"}
"""What the bits of an entry mean, from the lowest (CiA 301, CiA 406); others are their makers'."""


def advice_for(entry: od.ObjectEntry, value: int, code: str = "") -> str:
    """What to do, by the code of an emergency, or else by the lowest bit that has a known meaning."""
    keys = [code, code[:2], code[:1], *(key for bit, key in enumerate(_BITS[entry]) if value >> bit & 1)]
    unknown = "Look up what it means in the encoder's manual, and remove that; then measure again"
    return next((_ACTIONS[key] for key in keys if key in _ACTIONS), unknown)


class NodeMonitor:
    """Monitors one node, from before its configuration.

    Attributes:
        restarted: the node has booted or left OPERATIONAL; remains set.
        emergency: the reported error, until the node reports that it is gone.
        action: what to do then.
        emergencies: the number of reported errors.
        is_resting: its latest heartbeat says that it is not started.
    """

    def __init__(self, leg: Leg, bus: EncoderBus, heartbeat_ms: int) -> None:
        self.leg = leg
        self.restarted = False
        self.emergency: str | None = None
        self.action = ""
        self.emergencies = 0
        self.is_resting = False
        self.timeout_s = MAX_MISSED_HEARTBEATS * heartbeat_ms / 1000 + JITTER_S
        self._heartbeat_ms = heartbeat_ms
        self._last_heartbeat: float | None = None
        self._was_operational = False
        self._condition = bus.condition
        bus.network.subscribe(HEARTBEAT + leg.node, self._on_heartbeat)
        bus.network.subscribe(EMERGENCY + leg.node, self._on_emergency)

    def is_silent(self, now_s: float) -> bool:
        """Whether its heartbeat is overdue."""
        return self._last_heartbeat is not None and now_s - self._last_heartbeat > self.timeout_s

    def start_heartbeat(self, node: EncoderNode) -> str:
        """Set its heartbeat, or switch it off; a missing one is a fault from now on.

        Gives what a person should know: some nodes send none, only answer to guarding (CiA 301, 100Ch), or
        do not keep the setting. Their silence is a missing response to SYNC.
        """
        setting = node.read_optional(od.PRODUCER_HEARTBEAT)
        if setting or (setting is not None and self._heartbeat_ms):
            node.write(od.PRODUCER_HEARTBEAT, self._heartbeat_ms)
            setting = node.read(od.PRODUCER_HEARTBEAT)
        if self._heartbeat_ms and setting:
            self._last_heartbeat = time.monotonic()
        elif self._heartbeat_ms:
            return (
                f"it does not send a heartbeat ({od.PRODUCER_HEARTBEAT}): its silence is seen at a sample"
            )
        return ""

    def _on_heartbeat(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        if self._last_heartbeat is not None:
            self._last_heartbeat = time.monotonic()
        state = data[0] & 0x7F if data else BOOT_UP
        self.is_resting = state != OPERATIONAL
        if state == OPERATIONAL:
            self._was_operational = True
        elif state == BOOT_UP or self._was_operational:
            self.restarted = True
            self._condition.notify_all()

    def _on_emergency(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        # Error code and error register; missing bytes count as an error.
        code, register = struct.unpack("<HB", bytes(data[:3]).ljust(3, b"\xff"))
        if code >> 8 == 0 and register == 0:
            self.emergency = None
            return
        self.emergencies += 1
        words = _KNOWN_EMERGENCIES.get(code) or EmcyError(code, register, b"", 0.0).get_desc().lower()
        self.emergency = f"emergency {code:04X} ({words}, error register {register:#04x})"
        self.action = advice_for(od.ERROR_REGISTER, register if len(data) > 2 else 0, f"{code:04X}")
        self._condition.notify_all()


def check_nodes(monitors: Sequence[NodeMonitor]) -> None:
    """Raise if a node restarted, its heartbeat is overdue, or it reports an error."""
    now_s = time.monotonic()
    restarted = [monitor.leg for monitor in monitors if monitor.restarted]
    if restarted:
        raise RestartedNodeError(
            "restarted, or was stopped, during the run and lost its configuration: the set is void",
            subject=subject_of(restarted),
            action="Check its supply, then repeat the set",
        )
    silent = [monitor for monitor in monitors if monitor.is_silent(now_s)]
    if silent:
        what = f"no heartbeat for {silent[0].timeout_s:.2g} s"
        raise silent_nodes(what, [monitor.leg for monitor in silent])
    for monitor in monitors:
        if monitor.emergency is not None:
            raise invalid_sample(f"reports {monitor.emergency}", monitor.leg.subject, monitor.action)


@dataclass(frozen=True, slots=True)
class AlarmTiming:
    """When alarm entries are read.

    Attributes:
        period_s: shortest period.
        bus_share: largest share of the time, where samples follow each other without a pause.
        warnings_every: warnings are read at one of so many readings: an SDO takes as long as a position.
    """

    period_s: float = 0.1
    bus_share: float = 0.02
    warnings_every: int = 10


@dataclass(eq=False)
class AlarmPoll:
    """Reads the alarm entries of all nodes: at first, after emergencies, and periodically.

    Some alarms come without an emergency, and stand in 1001h and 6503h only. On a slow bus a reading takes
    a quarter of the period. Where samples follow each other without a pause it is put off therefore.
    """

    nodes: Sequence[EncoderNode]
    monitors: Sequence[NodeMonitor]
    timing: AlarmTiming = AlarmTiming()
    _emergencies_seen: int = -1
    _polls: int = 0

    def __post_init__(self) -> None:
        self._begun_s = self._polled_s = self._sampling_s = self._cost_s = 0.0
        self._entries = [
            (node, entry)
            for node in self.nodes
            for entry in (od.ERROR_REGISTER, od.ALARMS, od.WARNINGS)
            if node.read_optional(entry) is not None
        ]
        # A warning that is there at the opening is a remark then, and need not end every run.
        self._known = {(node, one): node.read(one) for node, one in self._entries if one is od.WARNINGS}
        self.begin_sample()
        self.check()

    def begin_sample(self) -> None:
        """A sample is taken from now on until :meth:`check`."""
        self._begun_s = time.monotonic()

    def check(self) -> None:
        """Read the alarm entries if they are due. Raises ``InvalidSampleError``: there is an alarm."""
        now_s = time.monotonic()
        self._sampling_s += now_s - self._begun_s
        emergencies = sum([monitor.emergencies for monitor in self.monitors])
        since_s, timing = now_s - self._polled_s, self.timing
        is_cheap = since_s >= 2.0 * self._sampling_s or timing.bus_share * since_s >= self._cost_s
        if emergencies == self._emergencies_seen and not (since_s >= timing.period_s and is_cheap):
            return
        self._polls += 1
        self._emergencies_seen = -1  # due again at once, should one be found
        for node, entry in self._entries:
            if entry is od.WARNINGS and self._polls % timing.warnings_every != 0:
                continue
            value = node.read(entry)
            if entry is od.ERROR_REGISTER:
                value &= ~_COMMUNICATION
            if found := value & ~self._known.get((node, entry), 0):
                word = "a warning" if entry is od.WARNINGS else "an alarm"
                action = advice_for(entry, found)
                raise invalid_sample(f"has {word} ({entry} is {value:#06x})", node.leg.subject, action)
        self._emergencies_seen = emergencies
        self._polled_s, self._sampling_s = time.monotonic(), 0.0
        self._cost_s = self._polled_s - now_s
