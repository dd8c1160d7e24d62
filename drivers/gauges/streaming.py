"""Gauges that send values by themselves: the next fresh one counts, never one from before it was asked for.

A value that comes just after a move may have been measured before it: adapters, radio and the instrument
take time. So a frame counts only if its first byte came ``delay_s`` after the reading began, or later.
"""

from abc import abstractmethod
from enum import Enum, auto
from typing import ClassVar

from drivers.errors import EmptyChannel, GaugeSilent, WrongAnswer
from drivers.gauges.protocol import FrameRejected, GaugeState
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.serial.opening import SLICE_S
from drivers.serial.received import SHOWN_BYTES, quoted
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.clock import Patience
from hexacell.errors import DeviceError


class Origin(Enum):
    """Whose frame it is."""

    OWN = auto()
    ANOTHER_GAUGE = auto()
    STATUS = auto()
    UNKNOWN = auto()


class StreamingGauge(ValueOnlyGauge):
    """A gauge that nobody asks. Several may send on one line, each with its channel.

    A value may have been measured ``usual_delay_s`` before it comes, unless the cell file says how long.
    """

    value_request = terminator = b""
    verb = "sends"
    usual_delay_s: ClassVar[float] = 0.1

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        self._delay_s = self.usual_delay_s if settings.delay_s is None else settings.delay_s
        self._fresh_from_s = 0.0
        self._latest = 0

    @abstractmethod
    def _origin(self, frame: bytes) -> Origin:
        """Whose frame it is."""

    def _opened_state(self) -> GaugeState:
        """Every reading and every check begins here: what counts for it comes afterwards."""
        state = super()._opened_state()
        self._begin()
        return state

    async def _connect(self) -> None:
        await super()._connect()
        self._latest = self._open_port().listened.log.count
        self._begin()

    def _begin(self) -> None:
        self._fresh_from_s = self._open_port().listened.now() + self._delay_s

    async def _ask(self, _request: bytes) -> bytes:
        """The next fresh frame of this gauge."""
        port = self._open_port()
        now_s = port.listened.now()
        wait_s = max(self._fresh_from_s - now_s, port.line.settles_for_s(), 0.0) + self.settings.timeout_s
        patience, pieces = Patience(wait_s, SLICE_S, now_s), port.listened.log.pieces
        heard: dict[Origin, bytes] = {}
        while True:
            for frame in port.listened.log.after(self._latest):
                self._latest = frame.number
                origin = self._origin(frame.data)
                if frame.began_after_s < self._fresh_from_s:
                    continue
                if origin is Origin.OWN:
                    self._last_frame = frame.data
                    return frame.data
                heard[origin] = frame.data
            if patience.left_s(port.listened.now()) <= 0.0:
                raise self._missing(heard, (port.listened.log.pieces - pieces) / wait_s)
            await port.listen()
            port = self._open_port()

    def _missing(self, heard: dict[Origin, bytes], pieces_s: float) -> DeviceError | FrameRejected:
        """Why there was no frame, from those of other origins, or from what came ``pieces_s`` a second."""
        if Origin.UNKNOWN in heard:
            return FrameRejected(heard[Origin.UNKNOWN])
        last = f"; {quoted(self._last_frame)} came last" if self._last_frame else ""
        waited = f"sends nothing for {self.settings.timeout_s:g} s"
        if pieces_s and not heard:
            came = quoted(self._open_port().listened.log.latest[-SHOWN_BYTES:])
            return self._error(
                WrongAnswer,
                f"sends {pieces_s:.3g} a second, in another form: {came} came last, without a line end",
                "Correct baud rate in serial, or answer and ends_with of protocol stream, in the cell file",
            )
        if Origin.ANOTHER_GAUGE in heard:
            problem = f"channel {self.channel} {waited}, others on port {self.settings.port} do"
            check = "Switch its transmitter on, move its plunger off an end, or correct channel"
            return self._error(EmptyChannel, problem, f"{check} in the cell file")
        return self._error(
            GaugeSilent,
            f"{waited} on port {self.settings.port}{last}",
            "Switch it on and have it send by itself, move its plunger off an end, check its cable, "
            "port in the cell file, and settle_s there if it restarts when its port is opened",
        )

    def _require_silence(self) -> None:
        """Nothing: frames that come unasked are distinguished by their time."""
