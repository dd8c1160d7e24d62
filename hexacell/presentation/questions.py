"""Questions of a run, as a person reads them."""

from __future__ import annotations

from procedures.run.questions import GaugePlacement, PendingChange, Question, StepFailure


def question_text(question: Question) -> str:
    """The question for a terminal that reads one line as the answer."""
    match question.subject:
        case GaugePlacement(point=point, pose=pose):
            return (
                f"\nPoint {point}: the robot stands at {pose}.\n"
                "Put the three gauges around the ball, plungers in the middle of their travel.\n"
                "Press Enter when they stand. "
            )
        case PendingChange(gates=gates, diff=diff):
            conditions = "".join(f"{'ok' if gate.passed else 'NO'}  {gate.sentence}\n" for gate in gates)
            return f"\n{diff}\n{conditions}Write this into the controller's config? Type yes: "
        case StepFailure(problem=problem):
            return f"\n{problem}\nHow to go on ({', '.join(question.choices)})? "
