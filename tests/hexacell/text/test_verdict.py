"""The verdicts of calibrations and checks, as a person reads them."""

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.checks.check_result import CheckResult, ParameterChange
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.text.layout import COLUMNS
from hexacell.text.line_face import event_text
from hexacell.text.verdict import (
    check_text,
    not_checked,
    teaching_line,
    teaching_sentence,
    verification_text,
)
from hexacell.verdict.decision import GeometryErrors, JudgedError, Verdict, VerifiedAccuracy
from hexacell.verdict.either_side import EitherSide
from hexacell.verdict.model_evidence import ModelTest
from hexacell.verdict.verification import Verification
from procedures.run.state import RunState
from procedures.steps import events

WHEN = datetime(2026, 11, 20, 2, 30, tzinfo=UTC)


def accuracy(verdict: Verdict = Verdict.PASS) -> VerifiedAccuracy:
    return VerifiedAccuracy(
        position=JudgedError(value=0.036, expanded=0.04, limit=0.15, verdict=verdict),
        orientation=JudgedError(value=0.008, expanded=0.007, limit=0.05, verdict=Verdict.PASS),
        poses=6,
        task_named=True,
        worst=(0.0,) * 6,
    )


def outcomes(*passed: bool) -> tuple[ModelTest, ...]:
    return tuple(
        ModelTest(name=f"test {n}", passed=one, sentence=f"Test {n}.") for n, one in enumerate(passed)
    )


def result(verdict: Verdict, **changes: object) -> CheckResult:
    given = {
        "records": 15,
        "points": 2,
        "accuracy": accuracy(),
        "earlier_run": "runs/a",
        "earlier_at": WHEN,
    }
    return CheckResult.model_validate({"verdict": verdict, **given, **changes})


def test_a_verdict_fits_six_lines_with_what_must_be_taught_anew() -> None:
    verified = Verification(
        verdict=Verdict.PASS, tests=outcomes(True, True), accuracy=accuracy(), before_mm=4.9, after_mm=0.03
    )
    lines = verification_text(verified).splitlines()
    assert lines == [
        "verdict: pass; the model agrees with the records in 2 tests",
        "  largest position error at 6 task poses: 0.036 mm, U 0.040 (limit 0.15)",
        "  largest orientation error there: 0.008 deg, U 0.007 (limit 0.05)",
        "  mean deviation at held-out poses 4.90 -> 0.030 mm",
        f"  {not_checked()}",
    ]
    one_sided = accuracy().model_copy(update={"direction": -1})
    of_one_side = verification_text(verified.model_copy(update={"accuracy": one_sided})).splitlines()
    assert of_one_side[3] == "  for stops reached in the negative direction of every joint"
    assert [*of_one_side[:3], *of_one_side[4:]] == lines
    failed = Verification(verdict=Verdict.NOT_EVALUATED, tests=outcomes(True, False), accuracy=accuracy())
    lines = verification_text(failed).splitlines()
    assert lines[0] == "verdict: not evaluated"
    assert ("  Test 1." in lines, "  Test 0." in lines) == (True, False)


SIZES_MM = st.floats(1e-5, 1e4)


@given(SIZES_MM, SIZES_MM, SIZES_MM, st.sampled_from(Verdict), st.integers(1, 90))
def test_no_line_of_a_verdict_is_wider_than_a_terminal(value, expanded, limit, verdict, words) -> None:
    position = JudgedError(value=value, expanded=expanded, limit=limit, verdict=verdict)
    errors = accuracy().model_copy(update={"position": position, "poses": 1024, "task_named": False})
    geometry = GeometryErrors(position=position, orientation=errors.orientation)
    places = tuple(
        EitherSide(pose=(x, -50.0, 450.0, 0.0, 0.0, -20.0), legs=(2, 5), apart_mm=value) for x in (0.0, 1.0)
    )
    failed = ModelTest(name="test", passed=False, sentence="Much " * words)
    verified = Verification(
        verdict=verdict,
        tests=(failed,),
        accuracy=errors.model_copy(update={"of_geometry": geometry, "either_side": places}),
        before_mm=value,
        after_mm=expanded,
    )
    told = event_text(events.ResultValidated(verdict=verdict, line="", verification=verified), RunState())
    assert told is not None
    assert max(map(len, told.splitlines())) <= COLUMNS
    named = "X0.000 Y-50.000 Z450.000 A0.000 B0.000 C-20.000 the weight may as well lay legs 2, 5"
    assert all(words in " ".join(told.split()) for words in (named, "So at 1 other task pose."))


@pytest.mark.parametrize(
    ("verdict", "change", "said"),
    [
        (Verdict.PASS, 0.01, "  no parameter has changed significantly since 2026-11-20"),
        (Verdict.FAIL, 0.01, None),
        (Verdict.FAIL, -0.5, "  changed most since 2026-11-20: l3 by -0.500 mm (sigma 0.020)"),
    ],
)
def test_a_check_names_the_parameter_that_changed_most(verdict, change, said) -> None:
    changes = (
        ParameterChange(name="S1x", unit="mm", change=0.02, sigma=0.02),
        ParameterChange(name="l3", unit="mm", change=change, sigma=0.02),
    )
    lines = check_text(result(verdict, changes=changes)).splitlines()
    assert lines[0] == f"verdict: {verdict.value}"
    assert [line for line in lines if "changed" in line] == ([] if said is None else [said])
    assert lines[-1] == f"  {not_checked()}"


@pytest.mark.parametrize(
    ("mm", "deg", "figures"), [(30.775, 4.227, "30.8 mm, 4.23 deg"), (0.0449, 1e-9, "0.045 mm, 0.001 deg")]
)
def test_what_must_be_taught_anew_is_an_order_only_where_it_must(mm, deg, figures) -> None:
    moved = TaskDisplacement(position_mm=mm, orientation_deg=deg, poses=6, is_within_limits=False)
    sentence = teaching_sentence(moved)
    assert sentence.startswith("Teach anew: Cartesian points, work and tool frames move by")
    assert f"by up to {figures} at the task poses. Points taught by joints stay." in sentence
    assert figures in teaching_line(moved)
    within = moved.model_copy(update={"is_within_limits": True})
    assert teaching_sentence(within).startswith("Nothing need be taught anew: taught points and frames")
