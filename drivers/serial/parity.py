"""The parity of received bytes, which pyserial sends but never checks.

A byte of wrong parity must not reach a parser as one that looks right. On a line with seven data bits no
frame has a byte with bit 7 set, so such bytes are what damage becomes: a terminal puts ``FF 00`` before a
damaged byte (PARMRK in termios(3)), and :class:`ParityInBit7` replaces it by ``FF``.
"""

import termios
from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum

from hexacell.errors import FileError

BIT_7 = 0x80
DAMAGED = 0xFF
IFLAG = 0
ODD_BITS = {"E": 0, "O": 1}


class ParityCheck(StrEnum):
    """Who checks the parity of received bytes: ``parity_check`` in a gauge's ``serial`` table.

    ``SOFTWARE`` is for lines that pass eight bits on, of which the last is the parity: a network server
    set to 8N2 has no terminal that could check it for a gauge with 7E2.
    """

    TERMINAL = "terminal"
    SOFTWARE = "software"


class ParityInBit7:
    """Parity as the eighth bit of every byte: ``7E2`` is ``8N2`` on the wire."""

    def __init__(self, odd: int) -> None:
        self._odd = odd

    def encode(self, data: bytes) -> bytes:
        """``data`` of seven bits a byte, with the parity in bit 7."""
        return bytes(byte | BIT_7 * self._parity_of(byte) for byte in data)

    def decode(self, data: bytes) -> bytes:
        """The bytes without their parity; ``DAMAGED`` where it is wrong."""
        return bytes(
            byte & ~BIT_7 if byte >> 7 == self._parity_of(byte & ~BIT_7) else DAMAGED for byte in data
        )

    def _parity_of(self, character: int) -> int:
        return (character.bit_count() + self._odd) % 2


def in_software(settings: dict[str, object]) -> ParityInBit7 | None:
    """Take the parity out of the settings of a line, if it is to be checked in software.

    ``settings`` are those of pyserial and ``parity_check``, which is removed from them.

    Raises:
        FileError: ``parity_check`` is unknown, or the line has not seven bits with a parity.
    """
    word = settings.pop("parity_check", ParityCheck.TERMINAL)
    if word not in set(ParityCheck):
        raise _refused(f"parity_check {word!r} is unknown", "Write 'terminal' or 'software'")
    if word == ParityCheck.TERMINAL:
        return None
    odd = ODD_BITS.get(str(settings.get("parity", "N")))
    if odd is None or settings.get("bytesize") != 7:
        raise _refused("parity_check 'software' wants 7 bits and a parity", "Write bytesize and parity too")
    settings.update(bytesize=8, parity="N")
    return ParityInBit7(odd)


def have_terminal_check(port: object, settings: Mapping[str, object]) -> None:
    """Have the terminal behind an opened port of pyserial mark bytes of wrong parity, if it is one."""
    descriptor = getattr(port, "fd", None)
    if descriptor is None or settings.get("parity", "N") not in ODD_BITS:
        return
    with suppress(termios.error):  # a pseudo-terminal has no parity
        attributes = termios.tcgetattr(descriptor)
        attributes[IFLAG] |= termios.INPCK | termios.PARMRK
        attributes[IFLAG] &= ~termios.IGNPAR
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _refused(problem: str, action: str) -> FileError:
    return FileError(f"its serial settings are refused: {problem}", action=f"{action} in its serial table")
