"""Results in words and tables that fit a terminal of 80 columns."""

from hexacell.cli.words.devices import device_words
from hexacell.cli.words.layout import wrapped

__all__ = ["device_words", "wrapped"]
