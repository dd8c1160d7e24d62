"""What can be made to go wrong on the simulated encoder bus; legs count from 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.simulated.encoders.bank import SimulatedEncoderBank

NO_MAGNET = 0xFF00
POSITION_ERROR = 0x21
"""Error register: generic and device profile specific."""


class EncoderFaults:
    """Injects faults into a bank, at once, from any thread."""

    def __init__(self, bank: SimulatedEncoderBank) -> None:
        self._bank = bank

    def unplug(self, leg: int) -> None:
        """The node vanishes; before ``start`` it was never there."""
        with self._bank.line.lock:
            self._bank.encoder(leg).unplug()
            self._bank.unplugged.add(leg)

    def plug_in(self, leg: int) -> None:
        """It comes back, without configuration."""
        with self._bank.line.lock:
            self._bank.unplugged.discard(leg)
            self._bank.encoder(leg).plug_in()

    def duplicate(self, leg: int) -> None:
        """A second device with the same node id and another serial number appears."""
        with self._bank.line.lock:
            self._bank.add_twin(leg)

    def silence(self, leg: int, *, silent: bool = True) -> None:
        """It no longer answers SYNC, but everything else."""
        with self._bank.line.lock:
            self._bank.encoder(leg).is_silent = silent

    def emergency(self, leg: int, code: int = NO_MAGNET, register: int = POSITION_ERROR) -> None:
        """It reports an error; ``clear_emergency`` takes it back."""
        with self._bank.line.lock:
            self._bank.encoder(leg).emergency(code, register)

    def clear_emergency(self, leg: int) -> None:
        """It reports that there is no error any more."""
        self.emergency(leg, 0, 0)

    def alarm(self, leg: int, bits: int = 1) -> None:
        """It raises alarms in 6503h without a message; 0 takes them back."""
        with self._bank.line.lock:
            self._bank.encoder(leg).set_alarms(bits)

    def reboot(self, leg: int) -> None:
        """It restarts and loses its configuration."""
        with self._bank.line.lock:
            self._bank.encoder(leg).boot()

    def stop_heartbeat(self, leg: int) -> None:
        """Its heartbeat ends; it still answers."""
        with self._bank.line.lock:
            self._bank.encoder(leg).stop_heartbeat()

    def delay(self, leg: int, seconds: float) -> None:
        """Its answers come so much later, with what it sampled at their SYNC: stale rounds."""
        with self._bank.line.lock:
            self._bank.encoder(leg).delay_s = seconds

    def kill_bus(self) -> None:
        """Every node falls silent for good."""
        self._bank.line.stop()
