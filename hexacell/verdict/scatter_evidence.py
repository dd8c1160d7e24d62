"""Scatter that the records of an identification show: do the held-out records confirm it?

Repeated readings and residuals show it falsely of a few healthy machines in 1,000
(:mod:`~hexacell.noise.repeats`), whose U is then above any useful limit. What chance may have shown counts
if the records that were held out are too far off as well for the noise without it.
"""

from collections.abc import Callable
from typing import NamedTuple

from hexacell.cell.model import CellSettings
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.robot.model import Robot
from hexacell.verdict.decision import Verdict
from hexacell.verdict.model_evidence import HELD_OUT, ModelTest
from hexacell.verdict.verification import HeldOut, Verification, verify

CONFIRMED = 0.1
"""Probability of the held-out records below which they confirm scatter. Where it is as large as the noise
they do so of 19 machines in 20 with 36 degrees of freedom."""

NOT_CONFIRMED = (
    "Repeats and residuals show more scatter than the noise; the held-out records do not confirm it."
)


class JudgedResult(NamedTuple):
    """The robot with a result in its controller, and the identification, both with the same noise."""

    robot: Robot
    found: Identification

    @property
    def scatter(self) -> tuple[Noise, list[float]]:
        """The noise of the records, and the sizes of the effects, those of stops at work among them."""
        return self.robot.noise, [effect.size for effect in self.robot.effects]


def verify_with_scatter(
    settings: CellSettings,
    result: JudgedResult,
    beyond_chance: Callable[[], JudgedResult],
    held_out: HeldOut,
) -> Verification:
    """Verify a result whose records may show scatter by chance.

    ``beyond_chance`` gives the same with that scatter alone which is beyond chance.

    Raises:
        IdentifiabilityError: as :func:`.verify` does.
    """
    verification = verify(settings, *result, held_out)
    if verification.verdict is Verdict.PASS:
        return verification
    certain = beyond_chance()
    if certain.scatter == result.scatter:
        return verification
    without = verify(settings, *certain, held_out)
    probability = next((one.probability for one in without.tests if one.name == HELD_OUT), None)
    if probability is None or probability < CONFIRMED:
        return verification
    denied = ModelTest(name="scatter", passed=True, sentence=NOT_CONFIRMED)
    return without.model_copy(update={"tests": (*without.tests, denied)})
