"""When faults of a simulated cell are injected."""

from drivers.simulated.cell import SimulatedCell
from hexacell.cell.simulation import FaultKind


def injection_times(cell: SimulatedCell) -> list[float]:
    """A list that gets the time, on the cell's clock, of every fault that is injected from now on."""
    times: list[float] = []
    inject = cell.faults.inject

    def noted(kind: FaultKind, device: str = "") -> None:
        times.append(cell.physics._clock.now())
        inject(kind, device)

    cell.faults.inject = noted  # type: ignore[method-assign]
    return times
