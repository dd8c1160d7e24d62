"""The counter as a simulated cell has it."""

from typing import ClassVar

from drivers.simulated.gauges.instruments import SingleIndicator


class Counter(SingleIndicator):
    """Answers as the instrument does."""

    baudrate: ClassVar[int] = 19200
    at_end: ClassVar[bytes] = b"P=END\r\n"

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        """Sign, two digits, four decimals, and the unit."""
        return f"P={value:+08.4f} {'in' if inch else 'mm'}\r\n".encode("ascii")

    def _reply(self, command: str) -> bytes:
        match command:
            case "P?":
                return self._value(1)
            case "N?":
                return b"N=COUNTER7\r\n"
        return b""
