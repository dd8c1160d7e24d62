"""Text for what the time of a run is spent on."""

from hexacell.campaign.time_model import Seconds, calibration_seconds
from hexacell.cell.model import CellSettings

SHOWN_SECONDS = 3.0
"""What takes less is not told by itself."""


def spent_text(seconds: Seconds) -> str:
    """Minutes in all and of each kind, the largest first."""
    kinds = sorted(seconds, key=lambda kind: -seconds[kind])
    parts = [f"{kind} {seconds[kind] / 60.0:.1f}" for kind in kinds if seconds[kind] >= SHOWN_SECONDS]
    return f"{sum(seconds.values()) / 60.0:.1f} minutes{': ' if parts else ''}{', '.join(parts)}"


def spent_sentence(seconds: Seconds, settings: CellSettings, mode: str) -> str:
    """What a run was spent on, and what the cell file lets expect of a calibration."""
    factor = settings.timing.clock_factor
    clock = (
        "" if factor == 1.0 else f" by a clock {factor:g} times as fast, the program's own work included"
    )
    spent = f"It took {spent_text(seconds)}{clock}."
    if mode != "optimise":
        return spent
    return f"{spent} The cell file lets expect {spent_text(calibration_seconds(settings))}."
