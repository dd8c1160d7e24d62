"""Text for the questions that a run asks, and what counts as an answer."""

from __future__ import annotations

from procedures.run.questions import GaugePlacement, PendingChange, Question, StepFailure


def question_text(question: Question) -> str:
    """The question for a terminal that reads one line as the answer."""
    match question.subject:
        case GaugePlacement(point=point, pose=pose):
            return (
                f"\nPoint {point}: the robot is at {pose}.\n"
                "Put the three gauges around the ball, plungers in the middle of their travel.\n"
                "Press Enter when they are in place. "
            )
        case PendingChange(gates=gates, diff=diff):
            outcomes = "".join(f"{'ok' if gate.passed else 'NO'}  {gate.sentence}\n" for gate in gates)
            return f"\n{diff}\n{outcomes}Write this into the controller's config? Type yes: "
        case StepFailure(problem=problem):
            return f"\n{problem}\nHow to go on ({', '.join(question.choices)})? "


def repeated_text(question: Question) -> str:
    """What is shown after a line that is no answer."""
    return f"Type one of {', '.join(question.choices)}: "


def matching_choice(typed: str, question: Question) -> str | None:
    """The only choice that begins with the line typed; a space may stand for a hyphen."""
    answer = typed.strip().lower().replace(" ", "-")
    found = [choice for choice in question.choices if answer and choice.startswith(answer)]
    return found[0] if len(found) == 1 else None
