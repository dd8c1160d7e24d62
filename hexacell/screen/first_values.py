"""What the devices show while the rest of the program is still being loaded."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hexacell.cell.loader import Cell
    from hexacell.screen.device_watcher import DeviceWatcher
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.views import Card


class FirstValues:
    """Watches the devices of the cell at a path before the model of its screens is there, then for it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._cell: Cell | None = None
        self._devices: DeviceWatcher | None = None

    def load(self, on_change: Callable[[], None]) -> None:
        """Load the cell and what its devices need, in a thread; ``on_change`` is called for other values.

        Raises:
            FileError: the cell file cannot be read, or has one mistake.
            SeveralErrors: it has more than one.
        """
        # Loaded behind the first screen: numpy and pydantic take half a second, the model as much again.
        from hexacell.cell.loader import load_cell  # noqa: PLC0415
        from hexacell.run_process.live_devices import watch_devices  # noqa: PLC0415
        from hexacell.screen.device_watcher import DeviceWatcher  # noqa: PLC0415

        self._cell = load_cell(self._path)
        self._devices = DeviceWatcher(partial(watch_devices, self._cell), time.monotonic, on_change)

    def start(self) -> None:
        """Watch the devices from now on."""
        if self._devices is not None:
            self._devices.start()

    @property
    def are_known(self) -> bool:
        """Whether every device has shown something, or why it does not."""
        devices = self._devices
        return devices is not None and (
            bool(devices.problem) or (devices.live is not None and devices.live.is_complete)
        )

    def cards(self) -> tuple[Card, ...]:
        """A card for each device that has shown something; none before."""
        from hexacell.text.screens.devices import device_cards  # noqa: PLC0415 - see above

        if self._devices is None or self._devices.live is None:
            return ()
        return device_cards(self._devices.live, time.monotonic() - self._devices.live_at_s)

    def model(self) -> ScreenModel:
        """The model of the screens of the loaded cell, which watches the devices from now on."""
        from hexacell.screen.model import ScreenModel  # noqa: PLC0415 - see above
        from hexacell.screen.workplace import Workplace  # noqa: PLC0415 - see above

        assert self._cell is not None  # noqa: S101 - it is loaded first
        return ScreenModel(Workplace(self._cell), devices=self._devices)
