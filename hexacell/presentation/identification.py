"""The predicted accuracy, before and after.

The checks of the model against the data: residuals, noise, repeatability, correlations.

An identification for people: the verdict first, then the figures.

The parameters: drawing, identified, change, sigma, and what that means.
"""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.identification.diagnostics.pose_accuracy import PoseErrors
from hexacell.identification.diagnostics.repeatability import Repeatability
from hexacell.identification.diagnostics.variance_components import NoiseLevel, NoiseLevels
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry
from hexacell.presentation.layout import blocks, wrapped
from hexacell.reporting.assessment import Assessment
from hexacell.reporting.findings import findings, pair_sentences


def accuracy_table(assessed: Assessment) -> str:
    """Errors at the task poses with the geometry the controller has now, and with the identified one."""
    accuracy = assessed.accuracy
    if accuracy is None:
        return ""
    what = "task poses" if assessed.task_named else "poses across the workspace"
    title = f"Predicted error at {len(accuracy.poses)} {what}"
    return "\n".join(
        [
            f"{title:44}{'position, mm':>17}{'angle, deg':>18}",
            f"{'':44}{'rms':>8}{'largest':>9}{'rms':>9}{'largest':>9}",
            _line("geometry the controller has now", accuracy.before),
            _line("identified geometry (one sigma)", accuracy.after),
        ]
    )


def _line(name: str, errors: PoseErrors) -> str:
    return (
        f"  {name:42}{errors.position_rms_mm:8.3f}{errors.position_largest_mm:9.3f}"
        f"{errors.orientation_rms_deg:9.4f}{errors.orientation_largest_deg:9.4f}"
    )


def residual_line(found: Identification, goodness: ChiSquareTest) -> str:
    """The chi-square test."""
    return wrapped(
        f"Residual {found.residual_rms_mm:.4f} mm rms; chi-square {goodness.chi2:.1f}, expected "
        f"{goodness.expected:.1f} (probability {_probability(goodness.probability)}). {goodness.sentence}"
    )


def noise_table(noise: NoiseLevels | None) -> str:
    """Stated noise beside what the residuals show."""
    if noise is None:
        return ""
    if not noise.are_separable:
        return wrapped(noise.sentence)
    rows = (("encoders", noise.encoder), ("gauges", noise.gauge))
    lines = [f"  {name:10}{level.stated:9.4f}  {_seen(level)}" for name, level in rows]
    return "\n".join([f"{'Noise, mm':12}{'stated':>9}  seen in the residuals", *lines])


def repeatability_lines(scatter: Repeatability | None) -> str:
    """What visits of the same pose scatter by."""
    if scatter is None:
        return "Repeatability: not evaluated, no pose was measured twice."
    x, y, z = scatter.per_axis_mm
    return wrapped(
        f"Repeatability: on returning to {_counted(scatter.poses, 'pose')} the ball scatters by "
        f"x {x:.4f}, y {y:.4f}, z {z:.4f} mm "
        f"({_counted(scatter.degrees_of_freedom, 'degree')} of freedom)."
    )


def pair_lines(sentences: Sequence[str], strong: int) -> str:
    """The strongest correlations, and how many more there are."""
    if not strong:
        return ""
    lines = [wrapped(sentence, indent=2) for sentence in sentences]
    more = strong - len(sentences)
    if more:
        lines.append(f"and {_counted(more, 'more pair')} beyond 0.9 (--json lists them)")
    return "\n".join(lines)


def _seen(level: NoiseLevel) -> str:
    if not level.is_resolved:
        return f"below {level.at_most:.4f}: too small beside the other"
    return f"{level.estimated:.4f} +- {level.standard_error:.4f}"


def _probability(value: float) -> str:
    return f"{value:.2g}" if value >= 1e-4 else "below 0.0001"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def identification_words(found: Identification, drawing: Geometry, assessed: Assessment) -> str:
    """All that ``hexacell fit`` says of a result."""
    return blocks(
        [
            "\n".join(wrapped(sentence) for sentence in findings(found, assessed)),
            accuracy_table(assessed),
            _origin(found),
            parameter_table(found, drawing),
            residual_line(found, assessed.goodness),
            noise_table(assessed.noise),
            repeatability_lines(assessed.repeatability),
            pair_lines(pair_sentences(found, assessed), len(assessed.correlated)),
        ]
    )


def _origin(found: Identification) -> str:
    return wrapped(
        f"{len(found.free)} parameters from {found.records} records at {found.points} points; the "
        f"solver ended because {found.termination.value} ({found.iterations} iterations)."
    )


HEADER = f"{'mm':4}{'drawing':>10}{'identified':>12}{'change':>9}{'sigma':>8}"


def parameter_table(found: Identification, drawing: Geometry) -> str:
    """One line a parameter; those that the choice of frames fixes are left out."""
    undetermined = set(found.undetermined)
    rows = zip(PARAMETER_NAMES, drawing.vector(), found.geometry.vector(), found.sigma, strict=True)
    lines = [
        f"{name:4}{old:10.3f}{new:12.3f}{new - old:+9.3f}{sigma:8.3f}  "
        + ("not determined by these data" if name in undetermined else _moved(new - old, sigma))
        for name, old, new, sigma in rows
        if sigma > 0.0
    ]
    return "\n".join([HEADER, *lines])


def _moved(change: float, sigma: float) -> str:
    times = abs(change) / sigma
    return f"moved {times:.1f} sigma" if times < 99.95 else f"moved {times:.0f} sigma"
