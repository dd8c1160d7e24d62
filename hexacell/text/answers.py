"""What a person may type at a question, and what it means.

A question takes exactly what it offers; motion and changes begin only on an explicit answer.
"""

from __future__ import annotations

from dataclasses import dataclass

from procedures.run.questions import PLACED, Question, QuestionKind

YES, NO = ("yes", "y"), ("no", "n")


@dataclass(frozen=True, slots=True)
class TypedAnswer:
    """An answer to a question; ``value`` is none where the person declines."""

    value: str | None


def typed_answer(typed: str, question: Question, person: str) -> TypedAnswer | None:
    """The answer that a line is, none if it is no answer; ``person`` is who gives it."""
    line = typed.strip()
    match question.kind:
        case QuestionKind.PLACE_GAUGES:
            return None if line else TypedAnswer(PLACED)
        case QuestionKind.APPROVE_CHANGE | QuestionKind.KEEP_RESULT:
            return _consent_in(line.lower(), question.consent.lower(), person)
        case QuestionKind.CHOOSE_RECOVERY | QuestionKind.START_UP:
            chosen = matching_choice(line, question)
            return None if chosen is None else TypedAnswer(chosen)


def _consent_in(line: str, consent: str, person: str) -> TypedAnswer | None:
    if line == consent or (consent == YES[0] and line in YES):
        return TypedAnswer(person)
    return TypedAnswer(None) if line in NO else None


def matching_choice(typed: str, question: Question) -> str | None:
    """The only choice that begins with the line typed; a space may stand for a hyphen."""
    answer = typed.strip().lower().replace(" ", "-")
    found = [choice for choice in question.choices if answer and choice.startswith(answer)]
    return found[0] if len(found) == 1 else None


def request_text(question: Question) -> str:
    """What to type."""
    match question.kind:
        case QuestionKind.PLACE_GAUGES:
            return "Press Enter when they are in place, or type a to abort: "
        case QuestionKind.CHOOSE_RECOVERY:
            return f"Type one of {', '.join(question.choices)}: "
    if question.kind is QuestionKind.START_UP or question.consent == YES[0]:
        return "Type yes or no: "
    return f"Type the cell's name, {question.consent}, to take the responsibility, or no: "
