"""Text for a run as a whole: how it begins, what it asks, how to resume it, its end, and its replay."""

from __future__ import annotations

import shlex
from pathlib import Path

from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.layout import duration, wrapped
from hexacell.text.line_face import request_text
from hexacell.text.verdict import gate_lines, improvement_sentence, teaching_line, teaching_sentence
from procedures.calibration.calibration import Mode
from procedures.replay.replayer import Aspect, ReplayReport
from procedures.run.questions import (
    GaugePlacement,
    PendingChange,
    Question,
    StepFailure,
    UnreadyController,
    WrittenResult,
)
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


def clock_notice(factor: float) -> str:
    """How fast the clock of a simulated cell runs."""
    return f"The simulated cell's clock runs {factor:g} times as fast as real time."


def next_try_text(refusal: HexacellError, wait_s: float) -> str:
    """Why a run could not begin, and when it is tried again."""
    return f"{refusal}\nnot begun; tried again in {duration(wait_s / 60.0)}"


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


def question_text(question: Question) -> str:
    """The question for a terminal that reads one line as the answer."""
    match question.subject:
        case GaugePlacement(point=mounting, pose=pose, seat=int(seat)):
            return _mounting_text(mounting, seat, pose) + request_text(question)
        case GaugePlacement(station=station, pose=pose):
            return (
                f"\n{station[0].upper()}{station[1:]}: the robot is at {pose}.\n"
                "Put the three gauges around the ball, plungers in the middle of their travel.\n"
                f"{request_text(question)}"
            )
        case PendingChange(gates=gates, diff=diff, displacement=moved, improvement=improvement):
            sentences = filter(None, (improvement_sentence(improvement), teaching_sentence(moved)))
            facts = [gate_lines(gates), *(wrapped(one, indent=4) for one in sentences)]
            asked = f"Write this into the controller's config? {request_text(question)}"
            return "\n".join(["", diff, *filter(None, facts), asked])
        case WrittenResult(line=line, displacement=moved):
            keep = f"The new geometry is in the controller's config. Keep it? {request_text(question)}"
            taught = wrapped(teaching_sentence(moved), indent=4)
            return "\n".join(["", f"{line}.", *filter(None, [taught]), keep])
        case UnreadyController(problem=problem, request=request):
            return f"\n{wrapped(f'{problem}. {request}')}\n{request_text(question)}"
        case StepFailure(problem=problem):
            return f"\n{problem}\nHow to continue ({', '.join(question.choices)})? "


def _mounting_text(mounting: int, seat: int, pose: Pose) -> str:
    """Instructions for mounting the fixture and the gauges in a length check."""
    where = f"\nLength check, mounting {mounting}: the robot holds the ball at {pose}.\n"
    if mounting == 1:
        return (
            f"{where}Clamp the fixture with its first seat there, the second in the stated direction.\n"
            "Mount the gauges in the first seat around the ball, plungers in the middle of\n"
            "their travel, and zero them.\n"
        )
    return (
        f"{where}Mount the gauges in seat {seat}, the same way round. Do not zero them, and leave the\n"
        "fixture where it is.\n"
    )


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
