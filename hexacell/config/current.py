"""The controller's config as it is on the disk now."""

from __future__ import annotations

from pathlib import Path

from hexacell.config.contents import fingerprint
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout


class CurrentConfig:
    """The config that a controller is to run; parsed again when its content has changed."""

    def __init__(self, paths: tuple[Path, ...], layout: ConfigLayout) -> None:
        self._paths = paths
        self._layout = layout
        self._parsed: tuple[str, ControllerGeometry] | None = None

    @property
    def path(self) -> Path:
        """The config, or its first file, which stands for it in messages."""
        return self._paths[0]

    def geometry(self) -> ControllerGeometry:
        """The geometry that it states now; raises ``FileError``."""
        now = fingerprint(*self._paths)
        if self._parsed is None or self._parsed[0] != now:
            self._parsed = now, self._layout.read(*self._paths)
        return self._parsed[1]
