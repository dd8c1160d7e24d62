"""What may be wrong with a machine whose residuals are too large, where no cause is proven.

Each cause has the share of the excess that it would explain (:mod:`.excess_test`). Several causes may
explain the same residuals, so that the shares are no probabilities and have no sum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hexacell.identification.data_faults.fault_model import FaultHypothesis
from hexacell.identification.data_faults.hypotheses import (
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
    rank_hypotheses,
)
from hexacell.identification.solver.linearized_model import LinearizedModel
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import JointUnit
from hexacell.uncertainty.encoder_effects import encoder_eccentricities, encoder_scales
from hexacell.uncertainty.environment_effects import load_at_work
from hexacell.uncertainty.excess_test import ExcessTest
from hexacell.uncertainty.gauge_effects import ball_roundness
from hexacell.uncertainty.guide_effects import rail_directions, rail_waves

SMALLEST_SHARE = 0.1
"""Of the excess, that a cause must explain to be listed."""

WAVELENGTHS_MM = (600.0, 1500.0)
"""Waves of the rails that are longer than the travel of a slider at one point."""


@dataclass(frozen=True, slots=True)
class PossibleCause:
    """A cause that would explain a share (0 to 1) of the excess of the residuals, named for people."""

    name: str
    share: float


def possible_causes(found: Identification) -> tuple[PossibleCause, ...]:
    """The causes that explain something of residuals that are too large, the largest share first."""
    test = ExcessTest(found)
    causes = [*_of_the_machine(test), *_of_the_records(test)]
    listed = [cause for cause in causes if cause.share >= SMALLEST_SHARE]
    return tuple(sorted(listed, key=lambda cause: -cause.share))


def _of_the_machine(test: ExcessTest) -> Iterator[PossibleCause]:
    unit = test.found.problem.mechanism.words.joint_unit
    of_encoders = encoder_scales(1.0) if unit is JointUnit.MM else encoder_eccentricities(1.0)
    waves = (rail_waves(1.0, length) for length in WAVELENGTHS_MM)
    columns = {
        "errors of the encoders": [*test.by_effects(of_encoders), *test.by_encoders()],
        "guides that are not straight or parallel": test.by_effects(rail_directions(1.0), *waves),
        "legs that yield under the load": test.by_effects(load_at_work(1.0, 1.0)),
        "a temperature that changed while measuring": test.by_expansion(),
        "the gauges (scale, alignment, drift of the zero) or an oval ball": [
            *test.by_effects(ball_roundness(1.0)),
            *test.by_gauges(),
        ],
    }
    for name, parts in columns.items():
        yield PossibleCause(name, test.share_of_columns(parts))


def _of_the_records(test: ExcessTest) -> Iterator[PossibleCause]:
    """Of each kind of data fault the most likely one, if it is significant."""
    model = LinearizedModel.at_solution(test.found)
    kinds: set[type[FaultHypothesis]] = set()
    for hypothesis in rank_hypotheses(model, test.found.noise_test):
        if type(hypothesis) not in kinds:
            kinds.add(type(hypothesis))
            share = test.share_of_gain(hypothesis.gain, hypothesis.unknowns)
            yield PossibleCause(_name(hypothesis), share)


def _name(hypothesis: FaultHypothesis) -> str:
    match hypothesis:
        case OutlierHypothesis(records=((point, orientation), *_)):
            return f"a false reading at point {point}, orientation {orientation}"
        case ZeroShiftHypothesis(point=point, orientation=orientation):
            return f"a shift of the gauges' zero at point {point} before orientation {orientation}"
        case GaugeFaultHypothesis(gauge_fault=fault, point=point):
            where = "at every point" if point is None else f"at point {point}"
            return f"{fault.kind.value} ({', '.join(fault.gauges)}) {where}"
    raise TypeError(hypothesis)
