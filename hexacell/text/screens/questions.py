"""Text for the questions of a run, with the answers that they take."""

from collections.abc import Iterator
from dataclasses import replace

from hexacell.kinematics.pose import Pose
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.text.config_changes import pending_text
from hexacell.text.screens.views import Beside, Choice, QuestionView, Urgency
from hexacell.text.terms import found_sentence
from hexacell.text.verdict import improvement_sentence, teaching_sentence
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.run import questions

PERSON = "a person at the screen"
"""Who approves a change, as the journal has it."""

RECOVERIES = {
    "retry": "try the same again",
    "measure-again": "go back to the reference and take this record again",
    "redo-set": "discard this point and measure it again",
    "abort": "end the run; it can be resumed",
}
WHEN = {
    "retry": " (nothing was moved)",
    "measure-again": " (something moved)",
    "redo-set": " (a gauge was moved)",
}
"""After what each of them is right."""


def question_view(
    question: questions.Question, live: LiveSnapshot | None, person: str = PERSON
) -> QuestionView:
    """A question with what is to be known for it; ``person`` is who answers it."""
    match question.subject:
        case questions.GaugePlacement() as place:
            return _placement(place, live)
        case questions.PendingChange(gates=gates, displacement=moved, improvement=improvement) as pending:
            gain = improvement_sentence(improvement)
            lines = "\n".join(_gate_lines(gates))
            facts = teaching_sentence(moved), gain, found_sentence(pending.found), lines
            title = "Write the new geometry into the controller's config?"
            view = _consenting(question, person, "write it", title)
            change, refusal = f"The change:\n{pending_text(pending)}", approval_refusal(gates)
            return replace(view, paragraphs=tuple(filter(None, facts)), change=change, refusal=refusal)
        case questions.WrittenResult(line=line, displacement=moved):
            title, otherwise = "The result did not pass. Keep it all the same?", "restore the old config"
            view = _consenting(question, person, "keep it", title, otherwise)
            stands = (
                "The new geometry is in the controller's config. Without your word the old one is restored."
            )
            shown = tuple(filter(None, (f"{line}.", teaching_sentence(moved), stands)))
            return replace(view, paragraphs=shown, urgency=Urgency.ALARM)
        case questions.StepFailure(problem=problem):
            choices = (
                Choice(
                    str(number), RECOVERIES.get(choice, choice) + WHEN.get(choice, ""), choice, typed=choice
                )
                for number, choice in enumerate(question.choices, start=1)
            )
            return QuestionView(
                title="Something went wrong, and the robot stands still",
                paragraphs=(problem,),
                instruction="Mend it, then press a number:",
                choices=tuple(choices),
                beside=Beside.GAUGES if "gauge" in problem else Beside.NOTHING,
                urgency=Urgency.ALARM,
            )
        case questions.UnreadyController(problem=problem, request=request):
            title, asked = "The controller is not ready", (f"{problem}.", request)
            no = "no, end the run; it can be resumed", questions.NO
            return yes_or_no(title, asked, ("yes", questions.YES), no)


def _placement(place: questions.GaugePlacement, live: LiveSnapshot | None) -> QuestionView:
    if place.seat is None:
        title = f"Put the gauges around the ball at {place.station}"
        how = "Bring each plunger to the middle of its travel."
    else:
        title = f"Mount the gauges in seat {place.seat} of the fixture ({place.station})"
        how = "Mount them the same way round. Do not zero them, and leave the fixture where it is."
        if place.point == 1:
            how = (
                "Clamp the fixture with its first seat there, the second in the stated direction. Bring "
                "each plunger to the middle of its travel, and zero the gauges."
            )
    sides = [
        f"the {one.name} gauge on its {'+' if one.sign > 0 else '-'}{one.axis} side"
        for one in (live.gauges if live is not None else ())
    ]
    all_sides = f"All plungers point to the ball: {', '.join(sides)}." if sides else ""
    return QuestionView(
        title=title,
        paragraphs=(
            how,
            *filter(None, (all_sides,)),
            f"The robot holds the ball at {_pose_text(place.pose)}.",
        ),
        instruction="Press Enter when all three are in place.",
        choices=(Choice("enter", "they are in place: measure", questions.PLACED, is_consent=True),),
        beside=Beside.PLACING,
    )


def _pose_text(pose: Pose) -> str:
    """A pose with its units."""
    place, angles = pose.as_tuple()[:3], pose.as_tuple()[3:]
    millimetres = ", ".join(f"{axis} {value:.1f}" for axis, value in zip("xyz", place, strict=True))
    degrees = ", ".join(f"{axis} {value:.1f}" for axis, value in zip("abc", angles, strict=True))
    return f"{millimetres} mm; {degrees} deg"


def yes_or_no(
    title: str,
    paragraphs: tuple[str, ...],
    yes: tuple[str, str],
    no: tuple[str, str | None],
    more: str = "",
) -> QuestionView:
    """A question of consent by one key: the words and the value of each answer."""
    choices = Choice("y", *yes, is_consent=True), Choice("n", *no)
    return QuestionView(title, paragraphs, f"Press y or n{more}.", choices)


ABORTING = yes_or_no(
    "End this run?",
    ("The robot stops in place. What was measured is kept: r in 2 Preflight resumes the run.",),
    ("yes, end it", questions.YES),
    ("no, go on", None),
)

AGAIN_FOLLOWS = (
    "The robot goes back to the reference of its point. Where that shows something else by now, as the "
    "gauges have been moved, the whole point is measured again, and the present one after it."
)


def again_question(record: str) -> QuestionView:
    """What a person confirms before a record that was taken is taken once more."""
    title = f"Measure record {record} again?"
    yes = "yes, measure it again", questions.YES
    return yes_or_no(title, (AGAIN_FOLLOWS,), yes, ("no, keep it", None))


def _gate_lines(gates: tuple[AcceptanceGate, ...]) -> Iterator[str]:
    """What speaks against writing, and how many of the conditions for it are met."""
    passed = sum(gate.passed for gate in gates)
    yield f"ok  {passed} of {len(gates)} conditions for a write are met."
    for gate in (one for one in gates if not one.passed):
        decide = " Only you can know whether it is built so: measure it there, or decline."
        yield f"?   {gate.sentence}{decide}" if gate.needs_person else f"NO  {gate.sentence}"


def approval_refusal(gates: tuple[AcceptanceGate, ...]) -> str:
    """Why nobody can approve; empty where a person may."""
    failed = [gate.sentence for gate in gates if not gate.passed and not gate.needs_person]
    return f"It cannot be approved. {' '.join(failed)}" if failed else ""


def _consenting(
    question: questions.Question,
    person: str,
    what: str,
    title: str,
    otherwise: str = "leave the config as it is",
) -> QuestionView:
    """A question of consent: by one key, or by the cell's name where it is grave."""
    decline = f"no, {otherwise}", None
    if question.consent == "yes":
        return yes_or_no(title, (), (f"yes, {what}", person), decline, "; page up and page down scroll")
    instruction = (
        f"Type the cell's name, {question.consent}, and Enter to take the responsibility. "
        "Tab, then n declines; page up and page down scroll."
    )
    choices = (Choice("n", *decline),)
    return QuestionView(title, (), instruction, choices, typed=question.consent, consent=person)
