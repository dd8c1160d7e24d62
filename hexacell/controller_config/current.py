"""The controller's config as it is on the disk now."""

from __future__ import annotations

from pathlib import Path

from hexacell.controller_config.change import fingerprint
from hexacell.controller_config.interface import ConfigFormat, ControllerGeometry


class CurrentConfig:
    """The config that a controller is to run; parsed again when its content has changed."""

    def __init__(self, path: Path, config_format: ConfigFormat) -> None:
        self.path = path
        self._format = config_format
        self._parsed: tuple[str, ControllerGeometry] | None = None

    def geometry(self) -> ControllerGeometry:
        """The geometry that it states now; raises ``FileError``."""
        now = fingerprint(self.path)
        if self._parsed is None or self._parsed[0] != now:
            self._parsed = now, self._format.read(self.path)
        return self._parsed[1]
