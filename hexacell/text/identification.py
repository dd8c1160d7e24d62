"""Text for an identification: the findings first, then accuracy, parameters and checks of the model."""

from hexacell.identification.diagnostics.model_tests import contradicted_points
from hexacell.identification.identified_zeros import IdentifiedZeros
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import JointUnit
from hexacell.lengths import shown, unit_of
from hexacell.noise.record_noise import NoiseLevels, Repeatability
from hexacell.results.term_result import term_results
from hexacell.text.layout import counted, wrapped
from hexacell.text.measured_noise import measured_noise_text
from hexacell.text.parameters import parameter_rows, parameter_table
from hexacell.text.terms import terms_text
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.verdict.acceptance_gates import residual_sentence
from hexacell.verdict.assessment import Assessment
from hexacell.verdict.decision import Verdict
from hexacell.verdict.findings import findings, noise_sentence, pair_sentences


def identification_report(assessed: Assessment) -> str:
    """The whole report that ``hexacell fit`` prints."""
    found, budget = assessed.found, assessed.budget
    expanded = ""
    if budget is not None and not assessed.refused:
        size = f"is {shown(budget.expanded_mm)}"
        if not assessed.is_evident:
            size = "is not stated: the records contradict the model"
        expanded = f" U at the task poses {size}."
    pairs = [wrapped(sentence, indent=2) for sentence in pair_sentences(assessed)]
    if more := len(assessed.correlated) - len(pairs):
        pairs.append(f"and {counted(more, 'more pair')} beyond 0.9 (--json lists them)")
    parts = (
        "\n".join(wrapped(sentence) for sentence in findings(assessed)),
        wrapped(f"Verdict: {Verdict.NOT_EVALUATED}, as no held-out records test this model.{expanded}"),
        accuracy_table(assessed),
        budget_table(budget, is_evident=assessed.is_evident),
        wrapped(
            f"{len(found.free)} parameters from {found.records} records at {found.problem.points} points; "
            f"the solver ended because {found.termination.value} ({found.solution.iterations} iterations)."
        ),
        _identified(assessed),
        "\n".join(drawing_table(assessed.zeros or found, assessed.drawing)),
        terms_text(term_results(found)),
        residual_line(found),
        _points_line(assessed),
        noise_table(assessed.noise),
        "" if assessed.measured_noise is None else measured_noise_text(assessed.measured_noise),
        repeatability_lines(assessed.repeatability),
        "\n".join(pairs),
    )
    return "\n\n".join(part for part in parts if part)


def _points_line(assessed: Assessment) -> str:
    """Whether the records of each point agree with what the others predict."""
    if not assessed.points:
        return "Each point by the others: not evaluated, they do not determine the geometry."
    wrong = [str(point) for point in contradicted_points(assessed.points)]
    agreeing = f"{len(assessed.points) - len(wrong)} of {len(assessed.points)} agree"
    left = f", not point {', '.join(wrong)}" if wrong else ""
    return f"Each point by the others: {agreeing}{left}."


def accuracy_table(assessed: Assessment) -> str:
    """Predicted errors at the task poses with the controller's geometry and with the identified one."""
    if (accuracy := assessed.accuracy) is None:
        return ""
    what = "task poses" if assessed.task_named else "poses across the workspace"
    title = f"Predicted error at {len(accuracy.poses)} {what}"
    unit = unit_of(accuracy.after.position_largest_mm)
    lines = [
        f"{title:44}{f'position, {unit.name}':>17}{'angle, deg':>18}",
        f"{'':44}{'rms':>8}{'largest':>9}{'rms':>9}{'largest':>9}",
    ]
    names = "geometry the controller has now", "identified geometry (one sigma)"
    for name, errors in zip(names, (accuracy.before, accuracy.after), strict=True):
        rms, largest = errors.position_rms_mm, errors.position_largest_mm
        position = f"{unit.number(rms):>8}{unit.number(largest):>9}"
        angle = f"{errors.orientation_rms_deg:9.4f}{errors.orientation_largest_deg:9.4f}"
        lines.append(f"  {name:42}{position}{angle}")
    return "\n".join(lines)


def _identified(assessed: Assessment) -> str:
    if assessed.zeros is None:
        return ""
    zeros, free = assessed.zeros.kept.columns.shape[1], len(assessed.found.free)
    return wrapped(
        f"Identified: zeros only, {zeros} of {free}. All else is as the controller has it, and its "
        "tolerances are its uncertainty."
    )


def drawing_table(found: Identification | IdentifiedZeros, drawing: Geometry) -> tuple[str, ...]:
    """The drawing and the identified geometry, a line a parameter."""
    parameters = found.geometry.parameters
    rows = parameter_rows(
        parameters,
        drawing.vector,
        found.geometry.vector,
        found.sigma,
        undetermined=found.undetermined,
        held=() if isinstance(found, Identification) else set(parameters.names) - set(found.names),
    )
    return parameter_table(rows, "drawing", "identified")


def residual_line(found: Identification) -> str:
    """The residuals and the chi-square test."""
    goodness = found.goodness
    shown = f"{goodness.probability:.2g}" if goodness.probability >= 1e-4 else "below 0.0001"
    return wrapped(
        f"Residual {found.residual_rms_mm:.4f} mm rms; chi-square {goodness.chi2:.1f}, expected "
        f"{goodness.expected:.1f} (probability {shown}). {residual_sentence(goodness)}"
    )


def noise_table(noise: NoiseLevels | None) -> str:
    """Stated noise beside its estimate from the residuals."""
    if noise is None:
        return ""
    if not noise.are_separable:
        return wrapped(noise_sentence(noise))
    head = "Noise, mm" if noise.joint_unit is JointUnit.MM else f"Noise, {noise.joint_unit}, mm"
    lines = [f"{head:12}{'stated':>9}  estimated from the residuals"]
    for name, level in (("encoders", noise.encoder), ("gauges", noise.gauge)):
        estimate = f"below {level.at_most:.4f}: too small to be separated from the other"
        if level.is_resolved:
            estimate = f"{level.estimated:.4f} +- {level.standard_error:.4f}"
        lines.append(f"  {name:10}{level.stated:9.4f}  {estimate}")
    return "\n".join(lines)


def repeatability_lines(scatter: Repeatability | None) -> str:
    """The scatter of repeated visits to a pose."""
    if scatter is None:
        return "Repeatability: not evaluated, no pose was measured twice."
    x, y, z = scatter.per_axis_mm
    return wrapped(
        f"Repeatability: on returning to {counted(scatter.poses, 'pose')} the ball scatters by "
        f"x {x:.4f}, y {y:.4f}, z {z:.4f} mm "
        f"({counted(scatter.degrees_of_freedom, 'degree')} of freedom)."
    )


def budget_table(budget: UncertaintyBudget | None, *, is_evident: bool = True) -> str:
    """One line for the noise and each effect that matters, their sum, and what the records cannot show."""
    if budget is None:
        return ""
    unit = unit_of(budget.expanded_mm)
    title = f"Uncertainty at the worst task pose, {unit.name}"
    noise = "noise, and all that is not identified" if budget.has_held else "noise of the readings"
    expanded = f"U, 95 %, of the largest error of all poses (angle: {budget.expanded_deg:.3f} deg)"
    lines = [
        f"{title:44}{'size':>12}{'result':>8}{'direct':>8}{'both':>8}",
        f"  {noise:42}{'':12}{unit.number(budget.noise_mm):>8}{'':8}{unit.number(budget.noise_mm):>8}",
    ]
    for line in budget.lines:
        sizes = line.through_mm, line.direct_mm, line.combined_mm
        if max(sizes) >= unit.smallest:
            size = f"{line.effect.size:.3g} {line.effect.unit}"
            shares = "".join(f"{unit.number(mm) if mm else '-':>8}" for mm in sizes)
            lines.append(f"  {line.effect.name:42}{size:>12}{shares}")
    standard = "standard uncertainty (root of the squares)"
    lines.append(f"  {standard:70}{unit.number(budget.standard_mm):>8}")
    if is_evident:
        lines.append(f"  {expanded:70}{unit.number(budget.expanded_mm):>8}")
    unseen = []
    for line in budget.unseen:
        mm = line.per_unit_mm
        size = f"{mm:.2g} mm" if mm >= 0.1 else f"{1e3 * mm:.2g} um"
        unseen.append(f"{line.effect.name} ({size} by 1 {line.effect.unit})")
    if unseen:
        lines.append(wrapped(f"Not checked, as no record shows it: {', '.join(unseen)}.", indent=2))
    return "\n".join(lines)
