"""Thermometers on a simulated machine: files like those of the kernel, with what they show."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.simulated.served_device import Closeable
from hexacell.cell.devices import ThermometerSettings

SIMULATED = "simulated"
"""Path of a thermometer that is one of these."""

EVERY_S = 0.1


class SimulatedThermometers(Closeable):
    """Writes what thermometers show until it is closed; ``thermometers`` have the paths of their files."""

    def __init__(
        self, thermometers: Sequence[ThermometerSettings], celsius: Callable[[ThermometerSettings], float]
    ) -> None:
        self._folder = TemporaryDirectory(prefix="hexacell-")
        folder, self._celsius = Path(self._folder.name), celsius
        self.thermometers = tuple(
            one.model_copy(update={"path": str(folder / str(number))}) if one.path == SIMULATED else one
            for number, one in enumerate(thermometers)
        )
        self._shown = [one for one in self.thermometers if Path(one.path).parent == folder]
        self._is_closed = threading.Event()
        self._write()
        self._thread = threading.Thread(target=self._keep_writing, name="simulated thermometers")
        if self._shown:
            self._thread.start()

    def close(self) -> None:
        self._is_closed.set()
        if self._thread.is_alive():
            self._thread.join()
        self._folder.cleanup()

    def _keep_writing(self) -> None:
        while not self._is_closed.wait(EVERY_S):
            self._write()

    def _write(self) -> None:
        for one in self._shown:
            new = Path(f"{one.path}.new")
            new.write_text(f"{1000.0 * self._celsius(one):.0f}\n")
            new.replace(one.path)
