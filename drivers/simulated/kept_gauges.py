"""Where simulated gauges at a real controller stand: as real ones do, they stay when the program ends."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import numpy as np

from drivers.simulated.gauge_places import GaugePlaces
from hexacell.config.contents import fingerprint
from hexacell.errors import FileError
from hexacell.kinematics.rotations import Array
from hexacell.storage.atomic_files import write_atomically


class KeptGauges:
    """The file, beside the controller's config. It holds as long as the config is what it was then.

    With another geometry the same command leads elsewhere, and a person would place the gauges anew.
    """

    def __init__(self, config: tuple[Path, ...]) -> None:
        self.path = config[0].with_name(f".{config[0].name}.simulated-gauges")
        self._config = config

    def restore(self, places: GaugePlaces) -> None:
        """Put the gauges where they were, if that is known, and note from now on where they are put."""
        with suppress(OSError, FileError, ValueError, KeyError, TypeError):
            kept = json.loads(self.path.read_text())
            if kept["config"] == fingerprint(*self._config):
                station, triad = np.array(kept["station"], float), np.array(kept["triad"], float)
                places.stand(station.reshape(3), triad.reshape(3, 3))
        places.on_placed = self._keep

    def _keep(self, station: Array, triad: Array) -> None:
        # A folder that cannot be written is no reason to have no gauges.
        with suppress(FileError):
            kept = {
                "config": fingerprint(*self._config),
                "station": station.tolist(),
                "triad": triad.tolist(),
            }
            write_atomically(self.path, json.dumps(kept).encode())
