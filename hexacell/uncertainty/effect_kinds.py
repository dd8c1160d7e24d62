"""The kinds of systematic effects: of encoders, gauges and ball, guides, temperature and load.

The kinematic model has all rails straight and parallel; legs on the same rail have the same guide, and
the effects of rails have no columns in a mechanism without rails. Another temperature than that of the
measuring changes every length of a part by its coefficient of expansion, and the encoders' scales with
the base.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from hexacell.identification.placement import Placement, RecordPlacement, Weight, leg_forces
from hexacell.identification.thermal_expansion import BASE, UM_PER_M, longer_legs
from hexacell.kinematics.parameters import JointUnit, MachinePart
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import THOUSANDTH, Effect, Occurrence

COMMON_SCALE = "scale common to all encoders"
"""The effect that a length check measures."""


def common_encoder_scale(um_per_m: float) -> Effect:
    """All encoders are wrong by the same share, as of a common temperature or calibration.

    Nothing that the gauges measure distinguishes it from a machine that is larger by the same share.
    """

    def columns(at: Placement) -> Array:
        return at.by_joints(1e-6 * at.joints[..., None])

    return Effect(COMMON_SCALE, um_per_m, "um/m", Occurrence.CONSTANT, columns)


def encoder_scales(um_per_m: float) -> Effect:
    """Each encoder is wrong by a share of its own."""

    def columns(at: Placement) -> Array:
        return at.by_joints(1e-6 * at.joints[..., None] * at.each_leg)

    return Effect("scale of each encoder", um_per_m, "um/m", Occurrence.CONSTANT, columns)


def encoder_eccentricities(mdeg: float) -> Effect:
    """The disc of each rotary encoder is off its axis in any direction: its error is a sine over a turn.

    These are two causes a joint: a wave whose phase is unknown has half the variance in each.
    """

    def waves(at: Placement) -> Array:
        angles = np.radians(at.joints)[..., None]
        both = np.concatenate([np.cos(angles) * at.each_leg, np.sin(angles) * at.each_leg], axis=-1)
        return at.by_joints(THOUSANDTH * (np.sqrt(0.5) * both))

    return Effect("eccentricity of each encoder", mdeg, "mdeg", Occurrence.CONSTANT, waves)


REPEATABILITY = "repeatability"


def with_measured_stops(
    effects: Iterable[Effect], unseen: float, freedom: float, seen_freedom: float
) -> tuple[Effect, ...]:
    """Effects with what repeated readings show of stops.

    ``unseen`` is of those that encoders do not see, beyond what is stated, in um or mdeg, with its
    degrees of ``freedom``. The noise of the records contains it already.
    """

    def measured(effect: Effect) -> Effect:
        is_of_noise = effect.occurrence is Occurrence.STOPS_AT_WORK
        if not effect.name.startswith(REPEATABILITY):
            return replace(effect, freedom=seen_freedom) if is_of_noise else effect
        # What is in the noise already is beside it; what is stated of every stop is not.
        size = float(np.hypot(unseen, effect.size)) if is_of_noise else unseen
        if size > effect.size:
            at_work, source = Occurrence.STOPS_AT_WORK, "repeated readings"
            return replace(effect, size=size, occurrence=at_work, source=source, freedom=freedom)
        return replace(effect, freedom=freedom) if is_of_noise and freedom else effect

    return tuple(map(measured, effects))


def stop_repeatability(
    size: float, *, is_in_noise: bool = False, joint: str = "joint", unit: JointUnit = JointUnit.MM
) -> Effect:
    """A joint stops beside what its encoder shows, each time elsewhere: play, friction.

    ``size`` is in um or mdeg. ``is_in_noise``: the noise of the records contains it. ``joint`` is the
    mechanism's word for it.
    """
    occurrence = Occurrence.STOPS_AT_WORK if is_in_noise else Occurrence.EVERY_STOP
    return Effect(f"{REPEATABILITY} of a {joint}", size, unit.thousandth, occurrence, _by_stops)


def command_repeatability(size: float, *, joint: str = "joint", unit: JointUnit = JointUnit.MM) -> Effect:
    """A joint stops beside its command, each time elsewhere, and its encoder shows it.

    The records know it; the robot at work suffers it, whatever geometry commands it. ``size`` is in um or
    mdeg, ``joint`` the mechanism's word.
    """
    name = f"stops of a {joint} beside its command"
    return Effect(name, size, unit.thousandth, Occurrence.STOPS_AT_WORK, _by_stops)


def _by_stops(at: Placement) -> Array:
    """Errors of the poses (n, 6, J) by joints that stop a thousandth of their unit beside."""
    return at.by_joints(np.repeat(THOUSANDTH * at.each_leg[None], len(at), axis=0))


def temperature_at_work(kelvin: float, um_per_m_k: Mapping[MachinePart, float]) -> Effect:
    """The whole machine is warmer at work than it was while measuring."""
    expansion = partial(_warmer, um_per_m_k=um_per_m_k)
    return Effect("temperature at work", kelvin, "K", Occurrence.AT_WORK, expansion)


def temperature_while_measuring(kelvin: float, um_per_m_k: Mapping[MachinePart, float]) -> Effect:
    """The whole machine becomes warmer by this much from the first record to the last, evenly."""

    def expansion(placement: Placement) -> Array:
        return np.linspace(-0.5, 0.5, len(placement))[:, None, None] * _warmer(placement, um_per_m_k)

    return Effect("temperature while measuring", kelvin, "K", Occurrence.MEASURING, expansion)


def thermometers_of_legs(kelvin: float, um_per_m_k: float) -> Effect:
    """Each leg's thermometer is wrong by this much more at the last record than at the first, evenly.

    What all records have alike is a part of the identified geometry.
    """

    def expansion(at: Placement) -> Array:
        progress = np.linspace(-0.5, 0.5, len(at))[:, None, None]
        return np.asarray(progress * at.by_legs(longer_legs(at, um_per_m_k)[..., None] * at.each_leg))

    return Effect("thermometers of the legs", kelvin, "K", Occurrence.MEASURING, expansion)


def expansion_coefficients(percent: float, legs_um_m_k: float, base_um_m_k: float) -> Effect:
    """All legs, and the base, expand more than stated by this share of it."""

    def expansion(records: RecordPlacement) -> Array:
        warmer = records.warmer[:, : records.joints.shape[1]]
        legs, base = legs_um_m_k * warmer, base_um_m_k * records.warmer[:, BASE:]
        errors = np.stack([longer_legs(records, legs), longer_legs(records, -base)], axis=-1)
        return records.by_legs(0.01 * errors)[:, :3]

    name = "coefficients of thermal expansion"
    return Effect(name, percent, "%", Occurrence.MEASURING, on_readings=expansion)


def load_at_work(newton: float, um_per_n: float) -> Effect:
    """A force on the tool in any direction; ``um_per_n`` is the compliance of a leg with its joints."""

    def bending(placement: Placement) -> Array:
        # Virtual work: leg forces t hold a force F on the platform if J^T t = F. With A = -J^-1 the legs
        # yield by c t, and the platform by c A A^T F.
        inverse = placement.by_constraints[..., : placement.joints.shape[1]]
        return np.asarray(THOUSANDTH * um_per_n * inverse @ np.swapaxes(inverse[:, :3], -1, -2))

    return Effect("load at work", newton, "N", Occurrence.AT_WORK, bending)


LEGS_DIFFER = 0.3
"""Share by which the compliance of a leg, one standard deviation, differs from that of all legs."""


def own_weight(newton: float, um_per_n: float, weight: Weight) -> Effect:
    """Each leg yields by its part of a weight of so many newtons on the platform, all nearly alike.

    ``um_per_n`` is the compliance of a leg with its joints, one standard deviation.
    """

    def yielding(placement: Placement) -> Array:
        forces = leg_forces(placement, weight)[..., None] * placement.each_leg
        each = THOUSANDTH * um_per_n * placement.by_legs(forces)
        return np.concatenate([each.sum(axis=-1, keepdims=True), LEGS_DIFFER * each], axis=-1)

    return Effect("own weight", newton, "N", Occurrence.CONSTANT, yielding)


def _warmer(placement: Placement, um_per_m_k: Mapping[MachinePart, float]) -> Array:
    """Errors of the poses (n, 6, 1) by one kelvin."""
    parameters = placement.mechanism.parameters
    coefficients = {kind.symbol: um_per_m_k[kind.part] if kind.part else 0.0 for kind in parameters.kinds}
    changes = parameters.by_kind(coefficients) * placement.geometry.vector
    is_length = placement.mechanism.words.joint_unit is JointUnit.MM  # an angle does not expand
    joints = um_per_m_k[MachinePart.BASE] * is_length * placement.joints
    moved = placement.by_parameters(changes[:, None]) + placement.by_joints(joints[..., None])
    return np.asarray(UM_PER_M * moved)


def gauge_scales(um_per_mm: float, *, is_estimated: bool) -> Effect:
    """Each gauge is wrong by a share of its own."""

    def scales(records: RecordPlacement) -> Array:
        # Along the base axes, as the estimator has them: the gauges' own are within a degree of these.
        return np.asarray(1e-3 * records.deviations[:, :, None] * np.eye(3))

    return Effect(
        "scale of each gauge",
        um_per_mm,
        "um/mm",
        Occurrence.MEASURING,
        on_readings=scales,
        is_estimated=is_estimated,
    )


def ball_roundness(um: float) -> Effect:
    """The ball is oval: its radius differs from the mean by up to ``um``, in unknown directions."""
    return Effect("roundness of the ball", um, "um", Occurrence.MEASURING, on_readings=_oval)


def ball_beside_tool(mm: float) -> Effect:
    """The tool that works is not centred where the ball was, in any direction of the platform."""

    def beside(at: Placement) -> Array:
        return np.concatenate([at.poses.rotations, np.zeros_like(at.poses.rotations)], axis=1)

    return Effect("ball beside the tool's centre", mm, "mm", Occurrence.WITH_TOOL, beside)


def _oval(records: RecordPlacement) -> Array:
    """Errors by each spherical harmonic of degree 2, the mean square of all five together being 1/2.

    The plate of a gauge touches the ball where its normal is the gauge's direction.
    """
    touched = np.swapaxes(records.poses.rotations, -1, -2) @ records.gauges
    x, y, z = np.moveaxis(touched, -2, 0)
    harmonics = np.stack(
        [x * y, y * z, z * x, 0.5 * (x * x - y * y), (3.0 * z * z - 1.0) / np.sqrt(12.0)], axis=-1
    )
    return np.asarray(THOUSANDTH * np.sqrt(1.5) * np.einsum("ag,ngk->nak", records.gauges, harmonics))


def rail_directions(mrad: float) -> Effect:
    """Each rail points elsewhere, horizontally and vertically."""
    columns = partial(_across_rails, shapes=lambda along: 1e-3 * along[..., None])
    return Effect("direction of each rail", mrad, "mrad", Occurrence.CONSTANT, columns)


def rail_waves(um: float, wavelength_mm: float) -> Effect:
    """Each rail is wavy with an amplitude and a wavelength, horizontally and vertically.

    The phase may be any; a sine and a cosine whose factors have the variance a^2 / 2 each have the same
    second moments.
    """

    def waves(along: Array) -> Array:
        phase = 2.0 * np.pi * along / wavelength_mm
        return np.asarray(THOUSANDTH / np.sqrt(2.0) * np.stack([np.sin(phase), np.cos(phase)], axis=-1))

    name = f"waves of the rails, {wavelength_mm:g} mm long"
    return Effect(name, um, "um", Occurrence.CONSTANT, partial(_across_rails, shapes=waves))


def common_sag(um: float, half_length_mm: float) -> Effect:
    """All rails hang through alike, as a parabola ``um`` deep with its ends ``half_length_mm`` away.

    Nothing that the gauges measure distinguishes it from a slightly different geometry.
    """

    def sagging(placement: Placement) -> Array:
        if placement.guides is None:
            return np.zeros((len(placement), 6, 0))
        depth = THOUSANDTH * (placement.guides.along / half_length_mm) ** 2
        return placement.by_legs((placement.guides.across[..., 1] * depth)[..., None])

    return Effect("sag common to all rails", um, "um", Occurrence.CONSTANT, sagging)


def _across_rails(placement: Placement, shapes: Callable[[Array], Array]) -> Array:
    """Errors by displacements of some shapes (n, J, m) along the rails, each rail and direction alone."""
    if (guides := placement.guides) is None:
        return np.zeros((len(placement), 6, 0))
    on_rail = np.zeros((placement.joints.shape[1], len(guides.rails)))
    for rail, legs in enumerate(guides.rails):
        on_rail[list(legs), rail] = 1.0
    columns = np.einsum("nid,nim,ir->nidmr", guides.across, shapes(guides.along), on_rail)
    return placement.by_legs(columns.reshape(*placement.joints.shape, -1))
