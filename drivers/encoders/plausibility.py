"""Whether a sample can be one of these joints: its sign, and how far they went since the one before."""

from __future__ import annotations

import time
from collections.abc import Sequence

from drivers.encoders.node_monitor import invalid_sample
from drivers.errors import WrongSetting
from hexacell.cell.devices import EncoderSettings

NEGATIVE = 1 << 31
MARGIN = 1.0
"""What a joint may move beside its largest speed, in its unit: samples may follow each other at once."""


class SampleHistory:
    """The latest sample of six joints, for one opening of the encoders.

    ``subjects`` are the subjects of messages about legs 1 to 6.
    """

    def __init__(self, settings: EncoderSettings, subjects: Sequence[str]) -> None:
        self._settings = settings
        self._subjects = subjects
        self._latest: tuple[float, tuple[float, ...]] | None = None

    def check_signs(self, counts: tuple[int, ...]) -> None:
        """Raise ``WrongSetting`` if counts are negative ones, read as unsigned."""
        if self._settings.signed:
            return
        for subject, count in zip(self._subjects, counts, strict=True):
            if count >= NEGATIVE:
                raise WrongSetting(
                    f"shows {count} counts, as a negative number does that is read as unsigned",
                    subject=subject,
                    action="Write `signed = true` under [encoders]",
                )

    def check_speed(self, positions: tuple[float, ...]) -> None:
        """Raise ``InvalidSampleError`` if a joint went farther than it can; else keep the sample."""
        now, speed = time.monotonic(), self._settings.largest_speed
        if self._latest is not None and speed is not None:
            before_s, before = self._latest
            farthest = MARGIN + speed * (now - before_s)
            for subject, one, other in zip(self._subjects, before, positions, strict=True):
                if abs(other - one) > farthest:
                    unit = self._settings.unit
                    raise invalid_sample(
                        f"jumped from {one:.3f} to {other:.3f} {unit} in {now - before_s:.2g} s", subject
                    )
        self._latest = now, positions
