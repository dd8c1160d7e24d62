"""What the repeated readings of a run show: visits of the first reference, and each set's reference again.

They are compared with what the encoders say the ball did. How it moves by the joints is known roughly
before the geometry is identified, and well afterwards: the same readings then show the noise better.
"""

from collections.abc import Iterator

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.cell.devices import EncoderSettings
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.noise.allowances import Allowances, ReferenceChange
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.noise_assessment import NoiseReadings, assess_again
from hexacell.noise.standstill import display_step
from procedures.run.keys import Phase
from procedures.run.readings import Reading
from procedures.run.state import RunState, SetState


def noise_readings(
    measured: SetState, encoders: EncoderSettings, *, windows: int = 1, found: Identification | None = None
) -> NoiseReadings:
    """What was read at the reference of a set.

    Its record is no visit like the others if it is the mean of more ``windows``. Once backlash was
    ``found``, the joints of the visits are where they stand.
    """
    zero, series = measured.samples[0], measured.standstill
    gauges = [] if series is None else series.gauges_mm
    joints = [] if series is None else series.joints
    answers = zero.reading.answers if series is None else series.answers
    steps = [display_step([one[gauge] for one in answers]) for gauge in range(3)]
    visits = [*([zero.reading] if windows == 1 else []), *(visit.reading for visit in measured.visits)]
    visits = [reading for reading in visits if _is_comparable(reading, found)] or visits[:1]
    return NoiseReadings(
        reference=Pose(*zero.pose),
        series=np.concatenate([np.reshape(gauges, (-1, 3)), np.reshape(joints, (-1, 6))], axis=1),
        steps=np.array([*steps, *(encoders.step,) * 6]),
        visits=np.array([_gauges_and_joints(reading, found) for reading in visits]),
        window_readings=len(visits[0].counts),
    )


def _is_comparable(reading: Reading, found: Identification | None) -> bool:
    """Whether it is known where the joints stood: with backlash, from which side each had arrived."""
    terms = () if found is None or found.terms is None else found.terms.terms
    return all(reading.directions) or not any(term.needs_directions for term in terms)


def _gauges_and_joints(reading: Reading, found: Identification | None) -> Array:
    """What the gauges showed, mm, and where the joints stood (9,), as far as it is known."""
    joints = np.array(reading.joints)
    if found is not None and found.terms is not None and reading.directions:
        joints = found.terms.joints_stand(joints, np.array(reading.directions))
    return np.array([*reading.gauges_mm, *joints])


def since_zero(allowances: Allowances, measured: SetState, now: Reading) -> ReferenceChange:
    """How a reading at the reference of a set differs from the one with which it was zeroed."""
    zero = measured.samples[0]
    before, after = (_gauges_and_joints(one, allowances.found) for one in (zero.reading, now))
    return allowances.since(Pose(*zero.pose), before, after)


def repeated_readings(state: RunState, plan: Plan, allowances: Allowances) -> Iterator[ReferenceChange]:
    """At visits of the first reference, and at the end of each set before the geometry is identified."""
    if (visits := _visits(plan, state, allowances.found)) is not None:
        yield from allowances.between_visits(visits.reference, visits.visits)
    for key, one in state.sets.items():
        if key.phase is not Phase.IDENTIFY or not one.samples or one.closing is None:
            continue
        if all(_is_comparable(read, allowances.found) for read in (one.samples[0].reading, one.closing)):
            yield since_zero(allowances, one, one.closing)


def noise_again(plan: Plan, state: RunState, found: Identification) -> MeasuredNoise | None:
    """The measured noise by the visits, with the geometry that was identified; None without."""
    if state.noise is None or (visits := _visits(plan, state, found)) is None:
        return None
    return assess_again(plan, visits, state.noise.noise, found)


def _visits(plan: Plan, state: RunState, found: Identification | None) -> NoiseReadings | None:
    """The visits by which the noise was measured; None where that set was measured again without."""
    if state.noise is None:
        return None
    visited = state.sets.get(state.noise.at)
    if visited is None or not visited.samples or len(visited.visits) < plan.settings.noise.revisits:
        return None
    windows = state.noise.noise.windows
    return noise_readings(visited, plan.settings.encoders, windows=windows, found=found)
