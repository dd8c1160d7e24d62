"""The cell whose runs are broken: small, fast, without noise, so that every run gives the same numbers.

Its only scatter would be rounding to the last digit on the wire, and that is the same each time: the
gauges are put exactly around the ball and nothing is drawn. An interrupted and resumed run must
therefore end with the very bytes that an uninterrupted one ends with.
"""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.runs.cell_lock import lock_path
from hexacell.runs.run_folder import RunFolder
from tests.small_cell import FREE, changed

POINTS = ((100.0, -100.0, 500.0), (-100.0, 100.0, 500.0))
ORIENTATIONS = 9
PATIENCE_S = 10.0  # a machine under load is no device that fails
HELD_OUT_ORIENTATIONS = 2

SMALL: dict[str, Any] = FREE | {
    "identification.points": POINTS,
    "identification.orientations": ORIENTATIONS,
    "verification.points": ((-100.0, -50.0, 450.0), (100.0, 100.0, 550.0)),
    "verification.orientations": HELD_OUT_ORIENTATIONS,
    "noise.encoder": 0.001,
    "noise.gauge_mm": 0.001,
    "noise.standstill_readings": 0,
    "noise.revisits": 0,
    "acceptance.position_mm": 5.0,
    "acceptance.orientation_deg": 2.0,
    "timing.readings": 2,
    "timing.clock_factor": 1000.0,
    "encoders.heartbeat_ms": 65535,
    "simulation.gauges.noise_mm": 0.0,
    "simulation.gauges.flicker_mm": 0.0,
    "simulation.gauges.placing_mm": 0.0,
    "simulation.gauges.latency_s": 0.0,
    "simulation.encoders.noise": 0.0,
    "simulation.encoders.flicker": 0.0,
    "simulation.encoders.latency_s": 0.0,
    "simulation.motion.ringing_mm": 0.0,
}
NEVER_GOOD_ENOUGH: dict[str, Any] = {"acceptance.position_mm": 1e-9}
"""No result passes this, so that what was written is rolled back."""
PROVISIONAL: dict[str, Any] = {"identification.provisional": True}
"""The controller is lent a geometry after the first point, which is taken back after the last."""

MEASURED: dict[str, Any] = {"noise.standstill_readings": 8, "noise.revisits": 2}
"""The noise is measured at the first reference."""


@dataclass(frozen=True)
class Site:
    """A folder with the cell in it, its controller's config, and its runs."""

    folder: Path

    @property
    def cell_path(self) -> Path:
        return self.folder / "cell.toml"

    @property
    def cell(self) -> Cell:
        return load_cell(self.cell_path)

    @property
    def config(self) -> Path:
        return self.cell.config_path

    def runs(self) -> list[RunFolder]:
        """Runs that have a journal, oldest first."""
        return [RunFolder(path.parent) for path in sorted(self.folder.glob("runs/*/*/journal.jsonl"))]

    def run(self) -> RunFolder:
        """The only run."""
        [run] = self.runs()
        return run

    def strangers(self) -> list[Path]:
        """Half-written files; those in the folder of a run that never began hurt nobody."""
        folders = [self.folder, *(run.path for run in self.runs())]
        return [path for folder in folders for path in folder.glob(".*.tmp")]

    def beside_the_config(self) -> set[str]:
        """Names in the cell's folder that a program may have put there."""
        return {path.name for path in self.folder.iterdir()} - {
            self.cell_path.name,
            self.config.name,
            lock_path(self.config).name,
            "runs",
        }


def make_site(folder: Path, *changes: dict[str, Any], timeout_s: float = PATIENCE_S) -> Site:
    """The cell in a folder of its own, with some values changed; its devices may take ``timeout_s``."""
    folder.mkdir(parents=True)
    source = load_cell(bundled_config("simulated-hexaglide"))
    patience = {"encoders.timeout_s": timeout_s, "guards.stale_s": timeout_s}
    together = {key: value for change in (SMALL, patience, *changes) for key, value in change.items()}
    settings = changed(source.settings, together)
    gauges = tuple(gauge.model_copy(update={"timeout_s": timeout_s}) for gauge in settings.gauges)
    (folder / "cell.toml").write_text(dump(changed(settings, {"gauges": gauges})))
    shutil.copy(source.config_path, folder)
    return Site(folder)
