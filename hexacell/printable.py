"""Text from outside made printable: nothing in it acts on a terminal, or hides how a line really reads."""

import logging
from unicodedata import category

TAB_COLUMNS = 4


def printable(text: str) -> str:
    r"""A text whose every sign but the line feed is seen; any other becomes an escape such as ``\u001b``.

    Those are controls (C0, C1), signs that reverse or hide text, and bytes that were no text. JSON and TOML
    have the same escapes.
    """
    if text.isprintable():
        return text
    return "".join(map(_seen, text.replace("\r\n", "\n").expandtabs(TAB_COLUMNS)))


def _seen(sign: str) -> str:
    if sign == "\n" or sign.isprintable() or category(sign) == "Zs":
        return sign
    return f"\\u{ord(sign):04x}" if ord(sign) <= 0xFFFF else f"\\U{ord(sign):08x}"


class PrintableFormatter(logging.Formatter):
    """Makes each entry of a log printable."""

    def format(self, record: logging.LogRecord) -> str:
        """The entry, with the traceback of an error."""
        return printable(super().format(record))
