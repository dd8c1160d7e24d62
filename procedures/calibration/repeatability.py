"""What the repeated readings of a run show: visits of the first reference, and each set's reference again.

They are compared with what the encoders say the ball did. How it moves by the joints is known roughly
before the geometry is identified, and well afterwards: the same readings then show the noise better.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.cell.devices import EncoderSettings
from hexacell.identification.problem.random_walk import NO_WALK, GaugeWalk
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.corrections import CorrectionKind
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.noise.allowances import Allowances, ReferenceChange, contrasts
from hexacell.noise.measured_noise import MeasuredNoise
from hexacell.noise.noise_assessment import NoiseReadings, assess_again
from hexacell.noise.repeats import Repeats
from hexacell.noise.reversal import Reversal, reversal_of
from hexacell.noise.standstill import display_step
from hexacell.noise.worsening import Worsening, worsening_of
from procedures.run.keys import Phase
from procedures.run.readings import Reading
from procedures.run.set_state import SetState
from procedures.run.state import RunState

BACKLASH = str(CorrectionKind.BACKLASH)


def noise_readings(
    measured: SetState, encoders: EncoderSettings, allowances: Allowances, *, windows: int = 1
) -> NoiseReadings:
    """What was read at the reference of a set.

    Its record is no visit like the others if it is the mean of more ``windows``. What the gauges showed is
    without the backlash that the ``allowances`` know.
    """
    zero, series = measured.samples[0], measured.standstill
    gauges = [] if series is None else series.gauges_mm
    joints = [] if series is None else series.joints
    answers = zero.reading.answers if series is None else series.answers
    steps = [display_step([one[gauge] for one in answers]) for gauge in range(3)]
    visits = [*([zero.reading] if windows == 1 else []), *(visit.reading for visit in measured.visits)]
    reference = Pose(*zero.pose)
    visits = [reading for reading in visits if _is_comparable(reading, allowances)] or visits[:1]
    return NoiseReadings(
        reference=reference,
        series=np.concatenate(
            [np.reshape(gauges, (-1, 3)), np.reshape(joints, (-1, len(zero.reading.joints)))], axis=1
        ),
        steps=np.array([*steps, *(encoders.step,) * len(zero.reading.joints)]),
        visits=np.array([_gauges_and_joints(reading, reference, allowances) for reading in visits]),
        window_readings=len(visits[0].counts),
    )


def _is_comparable(reading: Reading, allowances: Allowances) -> bool:
    """Whether it is known where the joints stood: with backlash, from which side each had arrived."""
    terms = () if allowances.terms is None else allowances.terms.terms
    matters = any(term.needs_directions for term in terms) or any(allowances.robot.corrections.backlash)
    return all(reading.directions) or not matters


def _gauges_and_joints(reading: Reading, reference: Pose, allowances: Allowances) -> Array:
    """What gauges, mm, and encoders showed at a reference (9,), without what backlash did to either.

    A controller that corrects it sends joints further, which the encoders show. While nothing is known of
    the backlash itself, it is what the controller corrects.
    """
    gauges, joints = np.array(reading.gauges_mm), np.array(reading.joints)
    if reading.directions:
        directions = np.array(reading.directions)
        further = 0.5 * np.array(allowances.robot.corrections.backlash[: len(directions)]) * directions
        joints = joints - further
        if allowances.terms is not None:
            beside = allowances.terms.beside_encoders(directions)
            gauges = gauges - allowances.ball_at(reference, joints).motion(beside + further)
    return np.array([*gauges, *joints])


def since_zero(allowances: Allowances, measured: SetState, now: Reading) -> ReferenceChange:
    """How a reading at the reference of a set differs from the one with which it was zeroed."""
    zero = measured.samples[0]
    reference = Pose(*zero.pose)
    before, after = (_gauges_and_joints(one, reference, allowances) for one in (zero.reading, now))
    unknown = _on_unknown_sides(zero.reading, allowances) + _on_unknown_sides(now, allowances)
    readings = readings_between(zero.reading, now, measured.readings, allowances.robot.noise.walk)
    return allowances.since(reference, before, after, unknown, readings)


def readings_between(before: Reading, after: Reading, counted: float, walk: GaugeWalk) -> float:
    """How many readings later one was taken, or in the mean interval of how many, if it is known."""
    if walk.interval_s <= 0.0 or before.at_s is None or after.at_s is None:
        return counted
    return max(0.0, after.at_s - before.at_s) / walk.interval_s


def _on_unknown_sides(reading: Reading, allowances: Allowances) -> Array:
    """How far joints (6,) may be beside their encoders by backlash that is known, on an unknown side."""
    if allowances.terms is None:
        return np.zeros(len(reading.joints))
    is_unknown = np.array(reading.directions or (0,) * len(reading.joints)) == 0
    return np.abs(allowances.terms.beside_encoders(is_unknown))


def repeated_readings(state: RunState, plan: Plan, allowances: Allowances) -> Iterator[ReferenceChange]:
    """At visits of the first reference, and at the end of each set before the geometry is identified.

    Where gauges are known to drift, the visits are left out: how far they did then is not in their changes.
    """
    is_drifting = allowances.robot.noise.walk.step_mm > 0.0
    if not is_drifting and (visits := _visits(plan, state, allowances)) is not None:
        yield from allowances.between_visits(visits.reference, visits.visits)
    for key, one in state.sets.items():
        if key.phase is not Phase.IDENTIFY or not one.samples or one.closing is None:
            continue
        if all(_is_comparable(read, allowances) for read in (one.samples[0].reading, one.closing)):
            yield since_zero(allowances, one, one.closing)


def drift_by_repeats(plan: Plan, state: RunState, allowances: Allowances) -> GaugeWalk:
    """How the gauges drift; nothing unless it is significant.

    What was measured of the noise contains the drift between the visits: what is stated does not.
    """
    walk = GaugeWalk(interval_s=_mean_interval_s(state))
    measured, stated = (
        replace(allowances, robot=replace(allowances.robot, noise=replace(noise, walk=walk)))
        for noise in (allowances.robot.noise, plan.robot.noise)
    )
    if not Repeats(tuple(repeated_readings(state, plan, measured))).show_drift(measured.robot.noise):
        return NO_WALK
    return walk._replace(step_mm=Repeats(tuple(repeated_readings(state, plan, stated))).drift_mm)


def _mean_interval_s(state: RunState) -> float:
    """The mean time from one reading of a set to the next, to their ends; 0 where one is not known."""
    sets = [one for key, one in state.sets.items() if key.phase is Phase.IDENTIFY and one.samples]
    ends = [(one.samples[0].reading.at_s, one.closing.at_s, one.readings) for one in sets if one.closing]
    first_s, last_s, readings = np.array(ends, dtype=float).reshape(-1, 3).T
    took_s = float(np.sum(last_s - first_s))
    return took_s / float(np.sum(readings)) if took_s > 0.0 else 0.0


def noise_again(
    plan: Plan, state: RunState, found: Identification, walk: GaugeWalk
) -> MeasuredNoise | None:
    """The measured noise by the visits, with the geometry that was identified; None without."""
    allowances = Allowances(plan.settings, plan.robot, is_measured=True, found=found)
    if state.noise is None or (visits := _visits(plan, state, allowances)) is None:
        return None
    visited = state.set(state.noise.at)
    # A random walk of n steps varies about its mean by a sixth of n.
    counted = len(visited.visits) + len(visited.pilots)
    every = [one.reading for one in visited.samples[:1]] + [one.reading for one in visited.visits]
    every.sort(key=lambda one: one.at_s or 0.0)
    steps = readings_between(every[0], every[-1], counted, walk) / 6.0 if every else 0.0
    return assess_again(plan, visits, state.noise.noise, found, walk.step_mm * float(np.sqrt(steps)))


def _visits(plan: Plan, state: RunState, allowances: Allowances) -> NoiseReadings | None:
    """The visits by which the noise was measured; None where that set was measured again without."""
    if state.noise is None:
        return None
    visited = state.sets.get(state.noise.at)
    if visited is None or not visited.samples or len(visited.visits) < plan.settings.noise.revisits:
        return None
    return noise_readings(visited, plan.settings.encoders, allowances, windows=state.noise.noise.windows)


def worsening_by_repeats(
    plan: Plan, state: RunState, found: Identification, walk: GaugeWalk
) -> Worsening | None:
    """What got worse from the first visits of a reference to the ends of the last sets, if anything did."""
    robot = replace(plan.robot, noise=replace(plan.robot.noise, walk=walk))
    allowances = Allowances(plan.settings, robot, is_measured=True, found=found)
    changes = [*repeated_readings(state, plan, allowances)]
    return worsening_of(changes, sum(one.readings > 0 for one in changes), robot.noise)


def reversal_by_repeats(plan: Plan, state: RunState, found: Identification) -> Reversal | None:
    """Reversal and repeatability by all visits of references before the geometry was identified.

    Those count at which it is known from which side every joint had arrived.
    """
    allowances = Allowances(plan.settings, plan.robot, is_measured=True, found=found)
    visits: list[tuple[ReferenceChange, Array]] = []
    for key, one in state.sets.items():
        if key.phase is not Phase.IDENTIFY or not one.samples:
            continue
        closing = [] if one.closing is None else [one.closing]
        readings = [one.samples[0].reading, *(visit.reading for visit in one.visits), *closing]
        known = [reading for reading in readings if reading.directions and all(reading.directions)]
        rows = np.array([[*one.gauges_mm, *one.joints, *one.directions] for one in known])
        reference = Pose(*one.samples[0].pose)
        before = np.array([0.0, 0.0, 0.0, *one.samples[0].reading.joints])
        visits += [
            (allowances.since(reference, before, before + row[: len(before)]), row[len(before) :])
            for row in contrasts(rows)
        ]
    stated, unit = plan.settings.model.backlash, plan.settings.mechanism.words.joint_unit
    if found.terms is not None and BACKLASH in {term.name for term in found.terms.terms}:
        return reversal_of(visits, *found.terms.of(BACKLASH), unit)
    legs = plan.settings.mechanism.joint_count
    return reversal_of(visits, np.zeros(legs), np.full(legs, stated), unit)
