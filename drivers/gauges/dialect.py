"""How a protocol looks on the line, and what to say when something else is heard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from drivers.gauges.errors import GaugeSilent, WrongAnswer

BIT_7 = 0x80
TERMINATOR = b"\r"  # of every question, and the first line end of every answer


@dataclass(frozen=True, slots=True)
class LineSettings:
    """A protocol's defaults for the serial port, as pyserial names them."""

    baudrate: int
    bytesize: int = 8
    parity: str = "N"
    stopbits: int = 1
    dtr: bool = True
    rts: bool = True
    exclusive: bool = True

    def overlaid(self, settings: Mapping[str, object]) -> dict[str, object]:
        """These defaults with the cell file's ``serial`` table over them."""
        return {**asdict(self), **settings}

    def __str__(self) -> str:
        return f"{self.baudrate} baud {self.bytesize}{self.parity}{self.stopbits}"


@dataclass(frozen=True, slots=True)
class Dialect:
    """One protocol: its name in the cell file, its makers, its line, and a typical answer."""

    protocol: str
    makers: str
    line: LineSettings
    example: str


def silence(subject: str, port: str, timeout_s: float, *, echo: bool) -> GaugeSilent:
    """Nothing came; with ``echo``, nothing but our own question."""
    if echo:
        return GaugeSilent(
            f"only our own question comes back from port {port}",
            subject=subject,
            action="Switch the gauge on and check that the cable is not looped",
        )
    return GaugeSilent(
        f"does not answer within {timeout_s:g} s on port {port}",
        subject=subject,
        action="Switch it on, check its cable, and port in the cell file",
    )


def wrong_answer(subject: str, dialect: Dialect, received: bytes) -> WrongAnswer:
    """Something came that is no frame of the protocol, again and again."""
    if any(byte & BIT_7 for byte in received):
        return WrongAnswer(
            f"answers {received!r}, bytes with bit 7 set",
            subject=subject,
            action=f"Check parity settings and baud rate: {dialect.protocol} uses {dialect.line}",
        )
    return WrongAnswer(
        f"answers {received!r} where protocol {dialect.protocol} has answers like {dialect.example!r}",
        subject=subject,
        action="Correct protocol or port in the cell file",
    )
