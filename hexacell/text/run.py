"""Text for a run as a whole: how it begins, what it asks, how to resume it, its end, and its replay."""

import shlex
from pathlib import Path

from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.layout import wrapped
from hexacell.text.screens.views import QuestionView
from hexacell.text.verdict import teaching_line
from procedures.calibration.calibration import Mode
from procedures.replay.replayer import Aspect, ReplayReport
from procedures.steps import events

REPEATED = "The check raised an alarm, which one unchanged machine in 100 does: it is made once more."
REPEATED_ALARM = "The alarm was raised again: the machine has changed."
NOT_REPEATED_ALARM = "The alarm was not raised again."

UNVERIFIED = (
    "The controller's config holds the new geometry, which is not verified yet: resuming "
    "verifies it, or restores the old one."
)

LISTED_DIFFERENCES = 10
"""How many differences of a replay are printed."""


def demo_opening(machine: str, config: Path) -> str:
    """What the demo is about to calibrate: the kind of machine, and its controller's config."""
    devices = "gauges on serial lines, encoders on CAN, TCP controller."
    return (
        f"{wrapped(f'A simulated {machine}: {devices}')}\n"
        "The geometry in its controller's config is wrong by millimetres:\n"
        f"  {config}"
    )


def resume_hint(request: RunRequest) -> str:
    """How to resume a run that was stopped."""
    return f"Stopped; what was measured is kept. To continue:\n  {resume_command(request)}"


def resume_command(request: RunRequest) -> str:
    """The shell command that resumes a run with a person at the terminal."""
    command = "length" if request.mode is Mode.LENGTH else "run"
    mode = ["--mode", request.mode.value] if request.mode in {Mode.CHECK, Mode.QUICK} else []
    words = ["hexacell", command, str(request.cell.path), "--resume", str(request.folder.path), *mode]
    return shlex.join(words)


def closing_lines(request: RunRequest, ended: events.Ended) -> tuple[str, ...]:
    """The run folder, what must be taught anew, and last the result in one line."""
    teaching = () if ended.displacement is None else (teaching_line(ended.displacement),)
    return (f"Everything about this run is in {request.folder.path}", *teaching, ended.line)


def question_text(view: QuestionView) -> str:
    """The question for a terminal that reads one line as the answer, as the screen asks it.

    The change of a config comes first: what decides about it is then in sight beside the question.
    """
    about = [text if "\n" in text else wrapped(text, indent=4) for text in view.paragraphs]
    if view.title.endswith("?"):
        return "\n".join(["", *filter(None, [view.change]), *about, f"{view.title}\n{view.request}"])
    return "\n".join(["", view.title, *about, view.request])


def replay_report(replayed: ReplayReport) -> str:
    """The differences, those that count first, and the verdict."""
    found = sorted(replayed.differences, key=lambda one: not replayed.counts(one))
    lines = [
        wrapped(f"{'NO' if replayed.counts(one) else '--'}  {one}", indent=4)
        for one in found[:LISTED_DIFFERENCES]
    ]
    if len(found) > LISTED_DIFFERENCES:
        lines.append(f"and {len(found) - LISTED_DIFFERENCES} more (--json lists them)")
    if any(one.aspect is Aspect.DECISION for one in found) and not replayed.is_same_software:
        lines.append(
            wrapped(f"{replayed.recorded_by} recorded it: {replayed.replayed_by} may decide otherwise.")
        )
    outcome = "the same as recorded"
    if not replayed.is_same:
        first = next(one for one in replayed.differences if replayed.counts(one))
        outcome = f"different, first in line {first.line} ({first.place})"
    what = f"{replayed.decisions} decisions and {replayed.results} results of {replayed.events} events"
    return "\n".join([*lines, f"{what}: {outcome}"])
