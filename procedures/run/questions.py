"""Questions that a run asks a person: plain data, so that any face can show and answer them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from hexacell.acceptance.gates import AcceptanceGate
from hexacell.cell.recovery import Action
from hexacell.kinematics.pose import Pose

PLACED = "placed"
"""The one answer to a request to place the gauges."""


class QuestionKind(StrEnum):
    """What is asked."""

    PLACE_GAUGES = "place"
    APPROVE_CHANGE = "approve"
    CHOOSE_RECOVERY = "decide"


@dataclass(frozen=True, slots=True)
class GaugePlacement:
    """Where the gauges are wanted: a point, counted from 1, and the pose the robot holds there."""

    point: int
    pose: Pose


@dataclass(frozen=True, slots=True)
class PendingChange:
    """A change of the controller's config: its acceptance gates, and the text change as a diff."""

    gates: tuple[AcceptanceGate, ...]
    diff: str


@dataclass(frozen=True, slots=True)
class StepFailure:
    """A failure, as the error message that describes it."""

    problem: str


@dataclass(frozen=True, slots=True)
class Question:
    """One question to a person. An answer is a text, or None.

    Attributes:
        kind: what is asked.
        text: the question in plain words, for a face that has none of its own.
        subject: what the question is about.
        choices: the answers that are accepted. If empty, any text is (the name of who approves) and
            None declines.
        default: the choice that an empty answer selects; None if a choice must be made.
    """

    kind: QuestionKind
    text: str
    subject: GaugePlacement | PendingChange | StepFailure
    choices: tuple[str, ...] = ()
    default: str | None = None

    def accepts(self, answer: str | None) -> bool:
        """Whether this is an answer to the question."""
        return not self.choices or answer in self.choices

    def resolve(self, answer: str | None) -> str | None:
        """The answer, or the default where none was given."""
        return self.default if answer is None else answer


def ask_placement(point: int, pose: Pose) -> Question:
    """Ask for the gauges to be placed around the ball; answered when they are."""
    return Question(
        QuestionKind.PLACE_GAUGES,
        f"Put the gauges around the ball at point {point} ({pose}).",
        GaugePlacement(point, pose),
        choices=(PLACED,),
        default=PLACED,
    )


def ask_approval(gates: Sequence[AcceptanceGate], diff: str) -> Question:
    """Ask whether the config may be written; answered by the name of who approves."""
    return Question(
        QuestionKind.APPROVE_CHANGE,
        f"Write this into the controller's config?\n{diff}",
        PendingChange(tuple(gates), diff),
    )


def ask_recovery(problem: str, choices: Sequence[Action]) -> Question:
    """Ask how to continue after a failure; answered by the value of one of the actions."""
    return Question(
        QuestionKind.CHOOSE_RECOVERY,
        problem,
        StepFailure(problem),
        choices=tuple(choice.value for choice in choices),
    )
