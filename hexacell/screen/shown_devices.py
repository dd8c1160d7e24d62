"""What the devices show: those of the run while one goes on, else those of the cell."""

from collections.abc import Callable

from hexacell.cell.model import CellSettings
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.run_follower import RunFollower
from hexacell.text.screens import devices
from hexacell.text.screens.placing import Placing, placing
from hexacell.text.screens.views import Line, Urgency
from procedures.run.keys import ThreeNumbers


class ShownDevices:
    """Views of the devices; ``settings`` gives the cell as it is stated now, ``now`` seconds."""

    def __init__(
        self,
        run: RunFollower,
        of_cell: DeviceWatcher,
        settings: Callable[[], CellSettings],
        now: Callable[[], float],
    ) -> None:
        self._run, self._of_cell, self._settings, self._now = run, of_cell, settings, now

    def live(self, *, is_running: bool) -> tuple[LiveSnapshot | None, float]:
        """What they showed last, and how long ago, s; ``is_running``: whether a run has them."""
        picture, watched = self._run.picture, self._of_cell
        if is_running:
            return picture.live, self._now() - picture.live_at_s
        return watched.live, self._now() - watched.live_at_s

    def gauges(self) -> list[Line]:
        """A line for each gauge, and one for the other devices."""
        return devices.gauge_lines(*self._measured())

    def placing(self) -> Placing:
        """How the gauges stand while they are placed."""
        return placing(self._measured()[0], self._settings().stations.mounting_mm)

    def figures(self) -> tuple[list[tuple[str, str, str, Urgency]], int]:
        """Axis, figure, bar and urgency of each gauge, and the number of records."""
        snapshot, _, zero = self._measured()
        records = sum(len(measured.samples) for measured in self._run.picture.state.sets.values())
        return devices.large_figures(snapshot, zero), records

    def _measured(self) -> tuple[LiveSnapshot | None, float, ThreeNumbers | None]:
        """What the devices of the run showed last, how long ago, s, and the zero of its set.

        Where no run has begun, these are the devices of the cell.
        """
        picture = self._run.picture
        if self._run.connection is None and self._of_cell.live is not None:
            return (*self.live(is_running=False), None)
        zero = None if picture.at is None else picture.state.zero_shown(picture.at)
        return (*self.live(is_running=True), zero)
