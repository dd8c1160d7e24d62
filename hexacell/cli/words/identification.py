"""An identification for people: the verdict first, then the figures."""

from __future__ import annotations

from hexacell.assessment import Assessment
from hexacell.cli.words.accuracy import accuracy_table
from hexacell.cli.words.checks import noise_table, pair_lines, repeatability_lines, residual_line
from hexacell.cli.words.layout import blocks, wrapped
from hexacell.cli.words.parameters import parameter_table
from hexacell.findings import findings, pair_sentences
from hexacell.geometry import Geometry
from hexacell.identification.result import Identification


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
