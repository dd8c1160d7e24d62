"""Questions that a run asks a person, as plain data for any user interface."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.interfaces import StartupAction
from hexacell.cell.recovery import Action
from hexacell.kinematics.corrections import CorrectionChange
from hexacell.kinematics.pose import Pose
from hexacell.results.result import ExpectedImprovement
from hexacell.results.term_result import NOTHING_FOUND, FoundTerms
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.run.keys import Phase, SetKey

PLACED = "placed"
"""The one answer to a request to place the gauges."""

YES, NO = "yes", "no"
"""The answers to whether the controller may be made ready, or is."""


@dataclass(frozen=True, slots=True)
class GaugePlacement:
    """Where the gauges are wanted: a point, counted from 1, and the pose the robot holds there.

    ``station`` is the point in words. In a length check the point is the number of the mounting, and
    ``seat`` (1 or 2) that of the fixture.
    """

    point: int
    pose: Pose
    station: str
    seat: int | None = None


@dataclass(frozen=True, slots=True)
class PendingChange:
    """A change of the controller's config: its acceptance gates, and the text change as a diff.

    ``corrections`` are the numbers beside the geometry that it changes, ``found`` what they are for.
    ``displacement`` is how far it moves taught points, ``improvement`` what it is for; None if that is not
    known.
    """

    gates: tuple[AcceptanceGate, ...]
    diff: str
    displacement: TaskDisplacement | None = None
    improvement: ExpectedImprovement | None = None
    corrections: tuple[CorrectionChange, ...] = ()
    found: FoundTerms = NOTHING_FOUND


@dataclass(frozen=True, slots=True)
class StepFailure:
    """A failure, as the error message that describes it."""

    problem: str


@dataclass(frozen=True, slots=True)
class WrittenResult:
    """A result in the controller's config that did not pass: the outcome in one line.

    ``displacement`` is how far it moves taught points; None if that is not known.
    """

    line: str
    displacement: TaskDisplacement | None = None


@dataclass(frozen=True, slots=True)
class UnreadyController:
    """Why the controller cannot move, and what a person is to permit, or to do at the controller.

    ``word`` is what the cell file may state in ``controller.startup`` to permit it; None if it cannot.
    """

    problem: str
    request: str
    word: str | None


@dataclass(frozen=True, slots=True)
class Question:
    """One question to a person. An answer is a text, or None.

    Attributes:
        choices: the answers that are accepted. If empty, any text is (the name of who approves) and
            None declines.
        default: the choice that an empty answer selects; None if a choice must be made.
        consent: what a person types to consent, where the answer is that person's name.
    """

    subject: GaugePlacement | PendingChange | StepFailure | WrittenResult | UnreadyController
    choices: tuple[str, ...] = ()
    default: str | None = None
    consent: str = "yes"


def ask_placement(at: SetKey, pose: Pose) -> Question:
    """Ask for the gauges to be placed around the ball, or mounted in a seat; answered when they are."""
    seat = at.seat if at.phase is Phase.LENGTH else None
    return Question(GaugePlacement(at.point, pose, at.station, seat), choices=(PLACED,), default=PLACED)


def ask_approval(change: PendingChange, *, cell: str) -> Question:
    """Ask whether the config of a cell may be written; answered by the name of who approves."""
    is_grave = any(gate.needs_cell_name and not gate.passed for gate in change.gates)
    return Question(change, consent=cell if is_grave else "yes")


def ask_recovery(problem: str, choices: Sequence[Action]) -> Question:
    """Ask how to continue after a failure; answered by the value of one of the actions."""
    return Question(StepFailure(problem), tuple(choice.value for choice in choices))


def ask_startup(needed: StartupAction, problem: str, *, is_theirs: bool) -> Question:
    """Ask whether the controller may be made ready; where that is a person's, whether it is."""
    request = _AT_THE_CONTROLLER if is_theirs else _STARTUP_REQUESTS[needed]
    is_permitted_by_file = not is_theirs and needed is not StartupAction.RESET_ESTOP
    subject = UnreadyController(problem, request, needed.value if is_permitted_by_file else None)
    return Question(subject, choices=(YES, NO))


_AT_THE_CONTROLLER = (
    "Find out why, release the emergency stop and reset it at the controller; this program does not. "
    "Is it reset?"
)
_STARTUP_REQUESTS = {
    StartupAction.RESET_INITIAL_ESTOP: "Reset the emergency stop?",
    StartupAction.RESET_ESTOP: "Is it released, and may the robot move? Reset the emergency stop?",
    StartupAction.SWITCH_ON: "Is nobody within its reach? Switch the machine on?",
    StartupAction.HOME: "Is its way free? Home it, which moves the machine?",
}


class Operator(Protocol):
    """Answers questions."""

    async def ask(self, question: Question) -> str | None:
        """The answer; raises ``AnswerNeeded`` if there is none."""
        ...
