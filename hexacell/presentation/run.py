"""Text for a run as a whole: how it begins, how to resume it, how it ended."""

from __future__ import annotations

import shlex
from pathlib import Path

from hexacell.application.calibration_run import RunRequest
from procedures.calibration.workflow import Mode
from procedures.run import events

UNVERIFIED = (
    "The controller's config holds the new geometry, which is not verified yet: resuming "
    "verifies it, or restores the old one."
)


def demo_opening(config: Path) -> str:
    """What the demo is about to calibrate."""
    return (
        "A simulated Hexaglide: gauges on serial lines, encoders on CAN, TCP controller.\n"
        "The geometry in its controller's config is wrong by millimetres:\n"
        f"  {config}"
    )


def clock_notice(factor: float) -> str:
    """How fast the clock of a simulated cell runs."""
    return f"The simulated cell's clock runs {factor:g} times as fast as real time."


def resume_hint(request: RunRequest) -> str:
    """How to resume a run that was stopped."""
    return f"Stopped; what was measured is kept. To go on:\n  {resume_command(request)}"


def resume_command(request: RunRequest) -> str:
    """The shell command that resumes a run with a person at the terminal."""
    mode = ["--mode", "check"] if request.mode is Mode.CHECK else []
    words = ["hexacell", "run", str(request.cell.path), "--resume", str(request.folder.path), *mode]
    return shlex.join(words)


def closing_lines(request: RunRequest, ended: events.Ended) -> tuple[str, str]:
    """Where everything about the run is, and its result in one line."""
    return f"Everything about this run is in {request.folder.path}", ended.line
