"""How simulated sliders go from one place to another: smoothly, and stoppable on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A path through joint vectors, timed by a smooth step.

    Attributes:
        path: (k, 6), mm, evenly spaced along the way.
        begins_s: on the cell's clock.
        duration_s: from rest to rest.
        stopped_s: when it was cut short.
    """

    path: Array
    begins_s: float
    duration_s: float
    stopped_s: float = np.inf

    @classmethod
    def rest(cls, joints: Array) -> Motion:
        """No motion: sliders standing at (6,), mm, for ever."""
        return cls(np.stack([joints, joints]), -1e9, 0.0)

    @property
    def ends_s(self) -> float:
        """When the sliders stand again."""
        return min(self.begins_s + self.duration_s, self.stopped_s)

    def fraction(self, now_s: float) -> float:
        """How much of the way is done, 0 to 1."""
        elapsed = min(now_s, self.stopped_s) - self.begins_s
        t = 1.0 if elapsed >= self.duration_s else max(0.0, elapsed / self.duration_s)
        return t * t * (3.0 - 2.0 * t)

    def place(self, now_s: float) -> float:
        """Where on the path the sliders are, in rows of it."""
        return self.fraction(now_s) * (len(self.path) - 1)

    def joints(self, now_s: float) -> Array:
        """Slider positions (6,), mm, at a time."""
        place = self.place(now_s)
        below = min(int(place), len(self.path) - 2)
        share = place - below
        joints: Array = (1.0 - share) * self.path[below] + share * self.path[below + 1]
        return joints
