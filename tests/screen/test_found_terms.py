"""What a run says of backlash, play and compliance: found, corrected or not, and what that gained."""

from collections.abc import Iterable
from dataclasses import replace

from hexacell.identification.terms.term import Finding
from hexacell.kinematics.corrections import Corrections, Six
from hexacell.results.result import ExpectedImprovement
from hexacell.results.term_result import FoundTerms, TermResult
from hexacell.text.screens.questions import question_view
from hexacell.text.terms import found_sentence, run_terms_text
from hexacell.text.verdict import improvement_sentence
from hexacell.verdict.decision import VerifiedAccuracy
from hexacell.verdict.verification import Verification
from procedures.run.questions import PendingChange, ask_approval
from procedures.run.state import fold
from procedures.steps import events


def taken(name: str, values: Six, sigma: Six) -> TermResult:
    return TermResult(
        name=name, finding=Finding.TAKEN, log_factor=86.0, unit="mm", values=values, sigma=sigma
    )


LOST, PLAYS = (0.05, 0.1, 0.08, 0.04, 0.09, 0.08), (0.07, 0.04, 0.1, 0.06, 0.09, 0.06)
FOUND = FoundTerms(
    (
        taken("backlash", LOST, (0.01, 0.01, 0.01, 0.01, 0.01, 0.02)),
        taken("play", PLAYS, (0.009, 0.009, 0.009, 0.009, 0.009, 0.009)),
    ),
    Corrections(backlash=LOST, play_mm=PLAYS, weight_n=100.0),
)


def told(
    history: Iterable[events.Event], found: FoundTerms = FOUND, alone_mm: float = 0.462
) -> tuple[events.Event, ...]:
    """The events of a calibration, had it found this; without it ``alone_mm`` of error would be left."""
    changed, update = [], dict[str, object]()
    for event in history:
        match event:
            case events.Identified(result=result):
                update = {"result": result.model_copy(update={"terms": found.terms})}
            case events.Proposed():
                update = {"corrections": found.corrections}
            case events.ResultValidated(
                verification=Verification(accuracy=VerifiedAccuracy() as accuracy) as verified
            ):
                alone = accuracy.position.model_copy(update={"value": alone_mm, "expanded": 0.441})
                accuracy = accuracy.model_copy(update={"alone": alone})
                update = {"verification": verified.model_copy(update={"accuracy": accuracy})}
            case _:
                update = {}
        changed.append(event.model_copy(update=update))
    return tuple(changed)


def test_what_was_found_is_said_with_its_size_and_what_corrects_it() -> None:
    said = found_sentence(FOUND)
    assert "backlash of 0.040 to 0.100 mm (one sigma 0.010 to 0.020), corrected by the controller;" in said
    assert "play of 0.040 to 0.100 mm (one sigma 0.009), corrected by the controller." in said
    left = found_sentence(replace(FOUND, corrections=Corrections(weight_n=100.0)))
    assert "0.020), its config has no place for it: scatter at work; play" in left
    assert left.endswith("its config has no place for it: the geometry does as much as it can.")
    rivals = TermResult(name="play", finding=Finding.NOT_DISTINCT, log_factor=9.0, rival="compliance")
    hidden = TermResult(name="backlash", finding=Finding.NOT_SHOWN, log_factor=-3.0)
    assert "cannot be told apart from compliance; nothing" in found_sentence(FoundTerms((rivals,)))
    assert found_sentence(FoundTerms((hidden,))) == ""


def test_a_run_says_what_that_gained_and_nothing_where_nothing_was_found(history) -> None:
    said = run_terms_text(fold(told(history)))
    assert said.startswith(found_sentence(FOUND))
    assert "30.8 mm with the config before, 0.462 +- 0.441 mm with the best geometry alone, 0.0" in said
    assert said.endswith(" mm with the new config.")
    by_side = run_terms_text(fold(told(history, alone_mm=0.0)))
    assert "30.8 mm with the config before, up to 0.441 mm with the best geometry alone, 0.0" in by_side
    assert run_terms_text(fold(history)) == ""
    expected = improvement_sentence(ExpectedImprovement(now_mm=1.2, expanded_mm=0.1))
    assert expected.endswith("1.2 mm with the current config, 0 +- 0.100 mm with this one.")


def test_who_approves_a_change_is_told_what_its_corrections_are_for(history) -> None:
    state = fold(event for event in told(history) if not isinstance(event, events.ResultValidated))
    asked = ask_approval(PendingChange((), "-1\n+2", found=state.found_terms), cell="bench")
    assert found_sentence(FOUND) in question_view(asked, None).paragraphs
