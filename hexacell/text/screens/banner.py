"""The banner of every screen: the state in a word, the one thing to do with its key, what comes next."""

from collections.abc import Sequence

from hexacell.cell.model import CellSettings
from hexacell.errors import ExitCode
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.run_process.messages import HostFailed
from hexacell.services.history.run_index import PastRun
from hexacell.text.layout import error_with_u
from hexacell.text.screens.measuring import remaining
from hexacell.text.screens.questions import question_view
from hexacell.text.screens.run_picture import RunPicture
from hexacell.text.screens.views import Banner, ChecklistItem, Mark, Urgency
from hexacell.text.verdict import teaching_line
from hexacell.verdict.decision import Verdict
from procedures.engine.command_loop import Status
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.base import StepOfSet
from procedures.steps.move import Move
from procedures.steps.place import Place

NO_RUN = Banner("NO RUN", "Press 2, look at everything, and start one with s", rest="Nothing moves.")
NOTHING_MOVES = "Nothing moves before a run is started."
ONCE_MENDED = "No key: it shows here by itself once it is mended."
RESUMING = "Press 2, then r resumes it: nothing is lost"
STARTING = Banner("STARTING", "Nothing to do: a process of its own connects to the devices")
AFTER_COMPUTING = {
    "identify": "the held-out poses are measured with the old geometry",
    "propose": "the change is shown in 4 Review and waits for approval",
    "commit": "the held-out poses are measured with the new geometry",
    "judge": "the verdict is shown in 4 Review",
}
"""What follows a step that moves nothing."""

URGENCIES = {Verdict.PASS: Urgency.GOOD, Verdict.FAIL: Urgency.ALARM, None: Urgency.CALM}
"""How much attention a verdict needs, if there is one; all others need some."""


def verdict_urgency(verdict: Verdict | None) -> Urgency:
    """How much attention a verdict needs, if there is one."""
    return URGENCIES.get(verdict, Urgency.ATTENTION)


def run_banner(picture: RunPicture, settings: CellSettings | None) -> Banner:
    """What goes on in a run, live or recorded."""
    if picture.described is None:
        return NO_RUN
    if picture.is_recorded:
        word = "RECORDED" if picture.state.verdict is None else picture.state.verdict.upper()
        rest = "space plays, arrows step, + and - the speed; nothing moves"
        urgency = verdict_urgency(picture.state.verdict)
        return Banner(word, _capital(_recorded(picture)), _following(picture, settings), rest, urgency)
    if picture.status is Status.ENDED:
        return _ended(picture)
    rest = ". ".join(filter(None, (remaining(picture, settings), _stopping(picture))))
    if picture.question is not None:
        return _asked(picture, rest)
    word, action, urgency = _word(picture), f"Nothing to do: {_doing(picture)}", Urgency.CALM
    if picture.status is Status.PAUSED:
        key = "p" if picture.may_command else "c to take over, then p"
        word, action = "PAUSED", f"Press {key} to go on; the robot stands still"
        urgency = Urgency.ATTENTION
    elif picture.status is Status.PAUSING:
        word, urgency = "PAUSING", Urgency.ATTENTION
    elif picture.status is Status.FAULTED:
        word, action, urgency = "STOPPED", "Nothing to do: the robot is stopped", Urgency.ALARM
    return Banner(word, action, f"Next: {_following(picture, settings)}", rest, urgency)


def _recorded(picture: RunPicture) -> str:
    if isinstance(picture.setback, events.Interrupted):
        return f"It ended early: {picture.setback.reason}"
    return picture.state.ended.line if picture.state.ended is not None else _doing(picture)


def _ended(picture: RunPicture) -> Banner:
    if (ended := picture.state.ended) is not None:
        verdict, judged = picture.state.verdict, picture.state.judged
        word, line = "DONE" if verdict is None else verdict.upper(), ended.line
        found = None if judged is None else judged.verification or judged.check
        if found is not None and (accuracy := found.accuracy) is not None:
            error = error_with_u(accuracy).replace("+-", "±")
            line = f"Position error {error} mm at the task poses, limit {accuracy.position.limit:g} mm"
        key = "2 and s calibrate" if verdict is Verdict.FAIL else "5 History all runs"
        is_kept = picture.state.committed is not None and not picture.state.rolled_back
        moved = picture.state.proposed.displacement if is_kept and picture.state.proposed else None
        following = f"4 Review shows the result, {key}." if moved is None else f"{teaching_line(moved)}."
        return Banner(word, line, following, "Nothing moves.", verdict_urgency(verdict))
    if why := picture.why_not_written:
        following = "Press 5: w there writes it after all; 2 and r ask again."
        return Banner("NOT WRITTEN", _capital(why), following, "", Urgency.ATTENTION)
    reason, action = "its process is gone without a word; the robot may still move", RESUMING
    if isinstance(picture.setback, events.Interrupted):
        reason = picture.setback.reason
    elif isinstance(picture.setback, HostFailed):
        reason = picture.setback.problem
        if picture.setback.exit_code == ExitCode.USAGE:  # as it is, it cannot be resumed
            action = picture.setback.action or RESUMING
        elif picture.setback.evidence_lost:
            action = "Press 2, then s begins a new run"
    return Banner("ENDED EARLY", action, _capital(reason), "", Urgency.ALARM)


def _asked(picture: RunPicture, rest: str) -> Banner:
    assert picture.question is not None  # noqa: S101 - asked by the caller
    view = question_view(picture.question, picture.live)
    if not picture.may_command:
        return Banner("WAITING", "Nothing to do: a question waits for who is in control", view.title, rest)
    action = f"{view.title} Press w" if view.title.endswith("?") else f"{view.title}: press w"
    word = "STOPPED" if picture.status is Status.FAULTED else "YOUR TURN"
    return Banner(word, action, "".join(view.paragraphs[:1]), rest, view.urgency)


def _word(picture: RunPicture) -> str:
    step = picture.step
    if isinstance(step, Move):
        return "ROBOT MOVES"
    if step is None and not picture.state.sets:
        return "STARTING"
    return "COMPUTING" if step is not None and step.moves_nothing else "MEASURING"


def _doing(picture: RunPicture) -> str:
    if (step := picture.step) is None:
        return "choosing the next pose" if picture.state.sets else "devices and controller are made ready"
    if isinstance(step, Move):
        name = step.at.name
        named = {0: f"a waypoint on the way to {name}", 1: f"the reference of {name}"}
        return f"moving to {named.get(step.orientation) or step.at.pose_name(step.orientation)}"
    doing = step.doing or step.kind
    return step.activity() or (f"{step.at.name}: {doing}" if isinstance(step, StepOfSet) else doing)


def _following(picture: RunPicture, settings: CellSettings | None) -> str:
    at, step = picture.at, picture.step
    if picture.state.ended is not None or isinstance(picture.setback, events.Interrupted):
        return "4 Review shows the result"
    if at is None or (step is not None and step.moves_nothing):
        otherwise = "the next pose" if picture.state.sets else "the robot goes to the first point"
        return AFTER_COMPUTING.get("" if step is None else step.kind, otherwise)
    if isinstance(step, Place):
        return "the reference is read, then the gauges are tried by small moves"
    return _after_set(picture.state, at, settings)


def _after_set(state: RunState, at: SetKey, settings: CellSettings | None) -> str:
    if settings is None:
        return "the next pose"
    is_identifying = at.phase is Phase.IDENTIFY
    plan = settings.identification if is_identifying else settings.verification
    points, taken = len(plan.points), len(state.set(at).samples)
    left = max(0, plan.orientations - taken)
    if left > 1:
        return f"{left} more records here, then the reference again"
    if at.point < points:
        by_hand = settings.stations.placement == "by-hand"
        place = "you put the gauges around the ball at" if by_hand else "it goes on at"
        return f"the reference again, then {place} point {at.point + 1} of {points}"
    return "identifying the geometry" if is_identifying else "the next part of the run"


def _stopping(picture: RunPicture) -> str:
    control = picture.control
    if control is not None and not control.is_in_control:
        return "You only watch; c takes over"
    return "a ends it" if picture.status is Status.PAUSED else "p pauses, a ends it"


def cell_banner(live: LiveSnapshot | None, problem: str) -> Banner:
    """What to do about the devices while no run goes on."""
    if live is None:
        return Banner("CONNECTING", problem or "Nothing to do: the devices are being opened")
    troubles = [(f"gauge {one.name}", one.problem) for one in live.gauges]
    troubles += [("encoders", live.encoders.problem), ("controller", live.controller.problem)]
    found = [f"{name}: {why.removeprefix(f'{name}: ')}" for name, why in troubles if why]
    if live.stop_reason:
        found.append(f"stop line: {live.stop_reason}")
    if found:
        more = f"{len(found) - 1} more below. " if len(found) > 1 else ""
        follows = f"{more}{ONCE_MENDED}"
        return Banner("MEND THIS", _capital(found[0]), follows, NOTHING_MOVES, Urgency.ALARM)
    return Banner("READY", "Press 2 to look at everything before the robot moves", rest=NOTHING_MOVES)


def preflight_banner(
    items: Sequence[ChecklistItem], *, is_checked: bool, is_checking: bool, is_running: bool
) -> Banner:
    """What to do before a run; ``is_checked``: whether somebody has looked at all ``items``."""
    rest = "Everything is looked at again before the first move."
    if is_running:
        return Banner("RUN GOES ON", "Press 3 to see it", rest=rest)
    if is_checking:
        return Banner("LOOKING", "Nothing to do: this takes some seconds, and nothing moves")
    if not is_checked:
        return Banner("TO CHECK", "Press Enter to look at everything; nothing moves", rest=rest)
    failed = [one for one in items if one.mark is Mark.FAILED]
    if failed:
        first, more = failed[0], f"; {len(failed) - 1} more below" if len(failed) > 1 else ""
        action = f"{_capital(first.name)}: {first.action or first.finding}"
        return Banner("NOT READY", action, f"Then press Enter to look again{more}.", rest, Urgency.ALARM)
    following = "k starts a check, which changes nothing; v tries the plan first."
    return Banner("READY", "Press s to start the calibration", following, rest, Urgency.GOOD)


def history_banner(runs: Sequence[PastRun] | None) -> Banner:
    """What to do with the past runs of a cell, the latest first; None while they are read."""
    if runs is None:
        return Banner("READING", "Nothing to do: the runs of this cell are being read")
    if not runs:
        return Banner("NO RUNS", "Press 2, look at everything, and start one with s")
    latest = runs[0].summary.verdict
    action, urgency = "Nothing to do: choose a run, Enter shows it again", Urgency.CALM
    if latest not in {None, Verdict.PASS}:
        action, urgency = f"Recalibrate with 2 and s: the latest run is a {latest}", Urgency.ATTENTION
    follows = "b restores the config that a run wrote, or the one before it, and asks first."
    return Banner("HISTORY", action, follows, NOTHING_MOVES, urgency)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
