"""The checks of the model against the data: residuals, noise, repeatability, correlations."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.cli.words.layout import wrapped
from hexacell.identification.goodness import Goodness
from hexacell.identification.repeatability import Repeatability
from hexacell.identification.result import Identification
from hexacell.identification.variance_components import NoiseLevel, NoiseLevels


def residual_line(found: Identification, goodness: Goodness) -> str:
    """The chi-square test."""
    return wrapped(
        f"Residual {found.residual_rms_mm:.4f} mm rms; chi-square {goodness.chi2:.1f}, expected "
        f"{goodness.expected:.1f} (probability {_probability(goodness.probability)}). {goodness.sentence}"
    )


def noise_table(noise: NoiseLevels | None) -> str:
    """Stated noise beside what the residuals show."""
    if noise is None:
        return ""
    if not noise.told_apart:
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
    if not level.seen:
        return f"below {level.at_most:.4f}: too small beside the other"
    return f"{level.estimated:.4f} +- {level.standard_error:.4f}"


def _probability(value: float) -> str:
    return f"{value:.2g}" if value >= 1e-4 else "below 0.0001"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
