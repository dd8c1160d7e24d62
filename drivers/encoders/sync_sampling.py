"""One SYNC, one position from each leg, all taken at the same instant.

Positions are never read by SDO: some devices answer that with an older sample.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import duplicated_node
from drivers.encoders.errors import BusError, Leg, SilentNodeError, WrongDeviceError
from drivers.encoders.node_identity import SECOND_RESPONSE_S
from drivers.encoders.node_monitor import silence_action
from drivers.encoders.pdo_configuration import PositionChannel

SYNC = 0x080
MAX_SYNCS = 3
LATE_RESPONSE_TIMEOUTS = 3
"""How long to listen after a round in which a late answer may have slipped, in timeouts."""


class SyncSampler:
    """Asks for rounds and keeps account: no leg may ever answer more often than it was asked.

    An answer that is late would pass for the answer to the next SYNC, and then the six positions
    would not be of one instant. So after an incomplete round the missing answers are waited for
    once more before the next SYNC. Those that stay away are written off, and then the next round
    counts only if nothing turns up after it: SYNCs that fail follow each other within two
    timeouts, and a leg that lags behind them answers at that pace.
    """

    def __init__(
        self, legs: Sequence[Leg], channels: Sequence[PositionChannel], bus: EncoderBus, timeout_s: float
    ) -> None:
        self._legs = legs
        self._channels = channels
        self._bus = bus
        self._timeout_s = timeout_s
        self._owed = [0] * len(legs)
        self._frames = [b""] * len(legs)
        self._place = {channel.cob_id: place for place, channel in enumerate(channels)}
        self._foreign_sync = False
        for channel in channels:
            bus.network.subscribe(channel.cob_id, self._on_position)
        bus.network.subscribe(SYNC, self._on_foreign_sync)

    def sample(self, *, signed: bool) -> tuple[int, ...]:
        """One complete round: counts of all legs.

        Raises:
            SilentNodeError: Some leg did not answer in any of ``TRIES`` rounds.
            DeviceError: As :meth:`EncoderBus.check`.
        """
        for _ in range(MAX_SYNCS):
            in_step = self._catch_up()
            self._ask()
            if not self._bus.wait_for(self._nothing_owed, self._timeout_s):
                continue
            if not in_step:
                self._bus.listen(LATE_RESPONSE_TIMEOUTS * self._timeout_s)
            self._bus.check()
            return self._decode(signed=signed)
        raise self._silent()

    def self_test(self, *, signed: bool) -> None:
        """Take one round and listen for answers too many.

        Raises:
            DeviceError: As :meth:`take`.
        """
        self.sample(signed=signed)
        self._bus.listen(SECOND_RESPONSE_S)

    def check(self) -> None:
        """Raise if somebody sent what was not asked for.

        Raises:
            DuplicatedNodeError: A leg sent more positions than there were SYNCs.
            BusError: Somebody else sends SYNC.
        """
        for leg, owed in zip(self._legs, self._owed, strict=True):
            if owed < 0:
                raise duplicated_node("sent more positions than there were SYNCs", leg)
        if self._foreign_sync:
            raise BusError(
                "somebody else sends SYNC here",
                subject=self._bus.name,
                action="Give the encoders a bus of their own, or switch the other master off",
            )

    def _catch_up(self) -> bool:
        """Wait for late answers; false if some had to be written off."""
        if self._bus.wait_for(self._nothing_owed, self._timeout_s):
            return True
        with self._bus.condition:
            self._owed = [min(owed, 0) for owed in self._owed]
        return False

    def _ask(self) -> None:
        with self._bus.condition:
            self._owed = [owed + 1 for owed in self._owed]
        self._bus.network.send_message(SYNC, b"")

    def _nothing_owed(self) -> bool:
        return not any(owed > 0 for owed in self._owed)

    def _decode(self, *, signed: bool) -> tuple[int, ...]:
        for leg, channel, frame in zip(self._legs, self._channels, self._frames, strict=True):
            if len(frame) < channel.length:
                raise WrongDeviceError(
                    f"sent {len(frame)} bytes where its position needs {channel.length}",
                    leg,
                    action="Open the encoders again; if it stays so, use another device",
                )
        pairs = zip(self._channels, self._frames, strict=True)
        return tuple(channel.counts(frame, signed=signed) for channel, frame in pairs)

    def _silent(self) -> SilentNodeError:
        silent = [leg for leg, owed in zip(self._legs, self._owed, strict=True) if owed > 0]
        return SilentNodeError(
            f"no answer to SYNC within {self._timeout_s:g} s, {MAX_SYNCS} times",
            *silent,
            action=silence_action(everybody=len(silent) == len(self._legs)),
        )

    def _on_position(self, can_id: int, data: bytearray, _timestamp: float) -> None:
        place = self._place[can_id]
        self._owed[place] -= 1
        self._frames[place] = bytes(data)
        if self._nothing_owed():
            self._bus.condition.notify_all()

    def _on_foreign_sync(self, _can_id: int, _data: bytearray, _timestamp: float) -> None:
        self._foreign_sync = True
