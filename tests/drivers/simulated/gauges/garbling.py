"""Answers as a disturbed line would change them."""

from random import Random

DIGITS = b"0123456789"
DATA_BITS = 7


def flip_digit(data: bytes, random: Random) -> bytes:
    """``data`` with one of its digits replaced by another one."""
    places = [place for place, byte in enumerate(data) if byte in DIGITS]
    if not places:
        return data
    place = random.choice(places)
    return _replaced(data, place, random.choice(DIGITS.replace(data[place : place + 1], b"")))


def flip_bit(data: bytes, random: Random) -> bytes:
    """``data`` with one bit of one byte flipped, bit 7 left alone."""
    if not data:
        return data
    place = random.randrange(len(data))
    return _replaced(data, place, data[place] ^ 1 << random.randrange(DATA_BITS))


def _replaced(data: bytes, place: int, byte: int) -> bytes:
    return data[:place] + bytes([byte]) + data[place + 1 :]
