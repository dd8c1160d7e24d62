"""A provisional geometry, lent to the controller while the points are measured.

With millimetres of error in its geometry a controller cannot be commanded to many of the poses that
the robot can take. A first estimate lifts that. It goes through the same write-back as a result, with
a backup of its own, and is taken back before anything is judged, proposed or left alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.fields import GeometryValues
from hexacell.cell.loader import Cell
from hexacell.controller_config.change import fingerprint, propose
from hexacell.controller_config.receipt import RECEIPT, Receipt
from hexacell.controller_config.write_back import commit, rollback
from hexacell.errors import HexacellError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.robot_model import config_format
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.workflow import Calibration, geometry_of
from procedures.guards.guards import Guards
from procedures.run import events
from procedures.run.cancellation import in_thread
from procedures.run.state import RunState

FOLDER = "lent"


@dataclass(frozen=True, eq=False)
class ProvisionalGeometry:
    """Lends for one run."""

    cell: Cell
    calibration: Calibration
    guards: Guards
    folder: RunFolder

    async def lend(self, state: RunState) -> events.Event:
        """Have the controller command with the estimate.

        Raises:
            WriteBackUndone: it did not take it; its config is as it was.
            HexacellError: there is no estimate, or the config cannot be written.
        """
        geometry = await in_thread(self.calibration.to_lend, state)
        receipt = await in_thread(self._write, geometry, state)
        try:
            await self.guards.reload()
        except HexacellError as error:
            await in_thread(rollback, receipt)
            raise WriteBackUndone(
                f"the controller did not take the provisional geometry ({error}); its config is as it was",
                subject=receipt.path,
                action="Run without `provisional`, or put that right; start the controller anew first",
            ) from error
        return events.ProvisionalApplied(
            geometry=GeometryValues.model_validate(
                {"S": geometry.S.tolist(), "B": geometry.B.tolist(), "l": geometry.l.tolist()}
            ),
            folder=FOLDER,
        )

    async def take_back(self, state: RunState) -> events.Event:
        """Put the controller's config back, bit for bit, and have it read.

        Raises:
            HexacellError: it cannot be; config and controller have what was lent as before.
        """
        held = holds_lent(self.folder, self.cell.config_path)
        if held:
            await in_thread(rollback, Receipt.of(_kept_in(self.folder)))
        try:
            await self.guards.reload()
        except HexacellError:
            # Far from level no pose of the old geometry may belong to the sliders. File and controller
            # must not differ meanwhile.
            if held and state.lent is not None:
                await in_thread(self._write, geometry_of(state.lent), state)
            raise
        return events.ProvisionalReverted()

    def _write(self, geometry: Geometry, state: RunState) -> Receipt:
        settings = self.cell.settings
        proposal = propose(
            self.cell.config_path,
            config_format(settings),
            settings.controller.config_format,
            self.calibration.robot.for_controller(geometry),
            fingerprint_at_start=state.started.config_sha256 if state.started else "",
        )
        return commit(proposal, _kept_in(self.folder))


def holds_lent(folder: RunFolder, config: Path) -> bool:
    """Whether a controller's config holds the geometry that a run lent it; raises ``FileError``."""
    kept = _kept_in(folder)
    return (kept / RECEIPT).is_file() and Receipt.of(kept).sha256_after == fingerprint(config)


def _kept_in(folder: RunFolder) -> Path:
    return folder.path / FOLDER
