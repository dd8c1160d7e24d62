"""Gates that an identified geometry must pass before it is written to a controller."""

from collections.abc import Sequence
from math import inf, isfinite

from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation
from hexacell.identification.solver.chi_square import CONTRADICTED_RATIO, ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.lengths import shown
from hexacell.results.result import IdentificationResult
from hexacell.results.term_result import impossible_terms
from hexacell.robot.model import Robot


class AcceptanceGate(Frozen):
    """A condition for writing back, whether it is met, and that as a sentence for people.

    ``needs_person``: where it is not met, a person may accept the geometry nevertheless, with
    ``needs_cell_name`` by typing the name of the cell.
    """

    name: str
    passed: bool
    sentence: str
    needs_person: bool = False
    needs_cell_name: bool = False

    @property
    def refuses(self) -> bool:
        """Whether it is not met, and no person can accept that just by agreeing."""
        return not self.passed and (self.needs_cell_name or not self.needs_person)


def gates_of_run(
    settings: CellSettings, robot: Robot, result: IdentificationResult, expired: Sequence[str] | None = None
) -> tuple[AcceptanceGate, ...]:
    """The gates of a run, by its result; the ``robot`` has the controller's geometry as it was before."""
    identified = result.estimate(robot.mechanism.parameters)
    return gates(
        identified,
        robot.tolerance_violations(identified),
        residuals=result.residuals,
        change_mm=robot.largest_change(identified.geometry),
        largest_change_mm=settings.acceptance.largest_change_mm,
        expired=expired,
        impossible=impossible_terms(robot.terms, result.terms),
    )


def gates(
    identified: GeometryEstimate,
    violations: Sequence[ToleranceViolation],
    *,
    residuals: ChiSquareTest,
    change_mm: float = 0.0,
    largest_change_mm: float = inf,
    expired: Sequence[str] | None = None,
    impossible: Sequence[str] = (),
) -> tuple[AcceptanceGate, ...]:
    """All gates of an identification, in the mechanism's frame convention.

    ``change_mm`` is the largest change of a parameter of the controller's, in the best choice of frames:
    other frames are no other robot. ``largest_change_mm`` may change without a person; without this limit
    nothing is written. ``expired`` are instruments whose certificate had expired when the run began; None
    without certificates. ``impossible`` is what no machine has (:func:`impossible_terms`).
    """
    names = ", ".join(f"{one.name} ({shown(one.change, '+', one.unit)})" for one in violations)
    checked = [
        AcceptanceGate(
            name="converged",
            passed=identified.termination.converged,
            sentence=f"The solver ended because {identified.termination.value}.",
        ),
        AcceptanceGate(  # a geometry that the noise does not explain is doubtful: a person decides
            name="agrees with the noise",
            passed=residuals.is_explained,
            sentence=residual_sentence(residuals),
            needs_person=not residuals.ratio > CONTRADICTED_RATIO,
        ),
        AcceptanceGate(  # the drawing may be of another machine
            name="within tolerance",
            passed=not violations,
            sentence=f"Beyond the drawing's tolerance: {names}."
            if violations
            else "Every parameter is within the drawing's tolerance.",
            needs_person=True,
            needs_cell_name=True,
        ),
    ]
    if isfinite(largest_change_mm):
        units = " or ".join(sorted({kind.unit.shown for kind in identified.geometry.parameters.kinds}))
        checked.append(
            AcceptanceGate(  # a robot that moves far from where it did may collide
                name="small change",
                passed=change_mm <= largest_change_mm,
                sentence=f"The largest change is {shown(change_mm, unit=units)}, the choice of frames "
                f"apart (limit without a person {largest_change_mm:g} {units}).",
                needs_person=True,
                needs_cell_name=not change_mm <= largest_change_mm,
            )
        )
    if impossible:
        sentence = " ".join(f"No machine has {one}." for one in impossible)
        checked.append(AcceptanceGate(name="physical", passed=False, sentence=sentence))
    if expired is not None:  # others do not accept a result by an instrument with an expired certificate
        sentence = "The certificates of the instruments were valid when the run began."
        if expired:
            sentence = f"The certificate has expired: {', '.join(expired)}."
        checked.append(
            AcceptanceGate(name="certified", passed=not expired, sentence=sentence, needs_person=True)
        )
    return tuple(checked)


def residual_sentence(test: ChiSquareTest) -> str:
    """The finding of the chi-square test."""
    match test.agreement:
        case ChiSquareVerdict.NOT_EVALUATED:
            return "There are no more records than unknowns: the residuals prove nothing."
        case ChiSquareVerdict.AGREES:
            return "The residuals agree with the stated noise."
        case ChiSquareVerdict.TOO_LARGE:
            return (
                f"The residuals are {test.ratio:.1f} times the stated noise: the machine does not "
                "repeat, a gauge has moved, or the noise is stated too small."
            )
        case ChiSquareVerdict.TOO_SMALL:
            return (
                f"The residuals are only {test.ratio:.2f} times the stated noise: it is stated too "
                "large, and every sigma with it."
            )
