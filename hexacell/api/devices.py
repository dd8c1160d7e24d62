"""What the devices of a cell show now; nothing moves."""

from html import escape
from typing import Self

from hexacell.api.follower import Follower
from hexacell.cell.loader import Cell
from hexacell.run_process.live_devices import watch_devices
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.text.line_face import gauges_text


class LiveDevices:
    """The devices of a cell, open until they are closed, as at the end of this context; nothing moves.

    No run can begin meanwhile.

    Raises:
        CellBusy: a run has them.
        HexacellError: a protocol has no driver, or a simulated cell cannot start.
    """

    def __init__(self, cell: Cell) -> None:
        self._shown: LiveSnapshot | None = None
        self._follower = Follower(lambda: watch_devices(cell), self._take, "the readings of the devices")
        self._follower.wait(lambda: self._shown)

    def read(self) -> LiveSnapshot:
        """What they show once each has answered, or its ``problem`` says why it does not."""
        return self._follower.wait(self._complete)

    def close(self) -> None:
        """Let the devices go."""
        self._follower.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return "" if self._shown is None else f"<pre>{escape(gauges_text(self._shown))}</pre>"

    def _take(self, snapshot: LiveSnapshot) -> None:
        self._shown = snapshot

    def _complete(self) -> LiveSnapshot | None:
        shown = self._shown
        return shown if shown is not None and shown.is_complete and not self._follower.is_over else None
