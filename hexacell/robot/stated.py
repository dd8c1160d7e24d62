"""The noise, limits and systematic effects that a cell file states, as the mathematics has them."""

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from hexacell.cell import uncertainty
from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry, ControllerLimits
from hexacell.errors import ReachError
from hexacell.identification.placement import Weight
from hexacell.identification.problem.prior import Noise
from hexacell.identification.terms.term import ModelTerm, StatedMachine
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, joint_zeros
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.limits.gauge_travel import GaugeTravel
from hexacell.limits.leg_limits import LegLimits
from hexacell.limits.limits import AxisLimits, Limits, ZeroedRanges
from hexacell.measurements.records import MEASURED_PARTS
from hexacell.plugins import Group, created
from hexacell.uncertainty import effect_kinds
from hexacell.uncertainty.effects import Effect

NO_CONE_DEG = 180.0


def noise_of(settings: CellSettings) -> Noise:
    """The noise of a record that a cell's settings state."""
    stated = settings.noise
    alignment = float(np.radians(settings.stations.alignment_deg))
    noise = Noise(
        stated.encoder,
        stated.gauge_mm,
        alignment,
        stated.gauge_scale,
        stops=stated.stops,
        joint_count=settings.mechanism.joint_count,
    )
    if stated.encoders is None and stated.gauges_mm is None:
        return noise
    encoders, gauges = noise.encoders.tolist(), noise.gauges_mm.tolist()
    return noise.with_devices(stated.encoders or encoders, stated.gauges_mm or gauges)


def stated_limits(settings: CellSettings, controller: ControllerGeometry, frames: FrameTransform) -> Limits:
    """The limits of a cell and of its controller's config, whose ``frames`` lead to the convention's."""
    limits = settings.limits
    lowest, highest, zeroed = _joint_ranges(settings, controller)
    axes = controller.limits.narrowed(ControllerLimits(axes=limits.axes.ranges)).axes or ()
    return Limits(
        limits.gauge_travel_mm,
        float(np.radians(limits.tilt_deg)),
        lowest,
        highest,
        limits.singularity_margin,
        frames,
        float(np.radians(limits.turn_deg)),
        AxisLimits(*zip(*(axis or (-np.inf, np.inf) for axis in axes), strict=True)),
        _leg_limits(settings, controller),
        gauge_travel_of(settings),
        shown_joints=zeroed,
    )


def gauge_travel_of(settings: CellSettings) -> GaugeTravel:
    """The travels of a cell's gauges."""
    x, y, z = sorted(settings.gauges, key=lambda gauge: gauge.axis)
    return GaugeTravel(
        settings.limits.gauge_travel_mm,
        (x.travel_mm / 2.0, y.travel_mm / 2.0, z.travel_mm / 2.0),
        (x.middle_coordinate_mm, y.middle_coordinate_mm, z.middle_coordinate_mm),
        settings.stations.mounting_mm,
    )


def _joint_ranges(
    settings: CellSettings, controller: ControllerGeometry
) -> tuple[Array, Array, ZeroedRanges | None]:
    """The narrowest of the stated ranges, (J,) lowest and (J,) highest, and what depends on the zeros."""
    limits, of_controller = settings.limits, controller.limits.joints
    legs = settings.mechanism.joint_count
    lowest, highest = np.full(legs, limits.joint_min), np.full(legs, limits.joint_max)
    if limits.joints is not None:
        low, high = np.transpose(limits.joints)
        lowest, highest = np.maximum(lowest, low), np.minimum(highest, high)
    if of_controller is None:
        return lowest, highest, None
    zeroed = ZeroedRanges(lowest, highest, *np.transpose(of_controller))
    if not settings.controller.joints_include_zeros:
        return *zeroed.at(np.zeros(legs)), None
    return *zeroed.at(joint_zeros(settings.mechanism, controller.geometry)), zeroed


def _leg_limits(settings: CellSettings, controller: ControllerGeometry) -> LegLimits | None:
    """The limits of passive joints and legs; None if the cell states none."""
    stated, distance = settings.limits.passive_joints, settings.limits.leg_distance_mm
    legs = settings.mechanism.joint_count
    cones = [np.broadcast_to(one, legs) for one in (stated.base_cone_deg, stated.platform_cone_deg)]
    if distance == 0.0 and np.min(cones) >= NO_CONE_DEG:
        return None
    middle = _legs_in_the_middle(settings, controller.branch)
    frames = settings.mechanism.normalize_frames(settings.drawing)[1]
    along = middle.directions
    base = _unit(middle.in_carriers(along)[0] if stated.base_axes is None else stated.base_axes)
    platform = (along @ middle.rotations)[0] if stated.platform_axes is None else stated.platform_axes
    base_cones, platform_cones = np.radians(cones)
    return LegLimits(
        base @ frames.base.T if middle.carriers is None else base,
        _unit(platform) @ frames.platform.T,
        base_cones,
        platform_cones,
        distance,
    )


def _legs_in_the_middle(settings: CellSettings, branch: Branch) -> Legs:
    """The legs of the untilted robot as drawn in the middle of its points and task poses within reach."""
    mechanism, drawing = settings.mechanism, settings.drawing
    tasks = [pose[:3] for pose in settings.task.poses]
    points = np.array([*settings.identification.points, *settings.verification.points, *tasks])
    every = PoseBatch(points, np.broadcast_to(np.eye(3), (len(points), 3, 3)))
    reached = points[np.isfinite(mechanism.inverse(drawing, branch, every)).all(axis=-1)]
    if not len(reached):
        raise _no_axes("the robot as drawn reaches none of the points of this cell")
    # The median: one point that is far from the others hardly moves it.
    middle = PoseBatch.at(np.median(reached, axis=0), np.eye(3)[None])
    joints = mechanism.inverse(drawing, branch, middle)
    if np.isnan(joints).any():
        raise _no_axes(f"the robot as drawn cannot reach {middle.pose(0)}, the middle of all points")
    return mechanism.legs(drawing, middle, joints)


def _no_axes(problem: str) -> ReachError:
    return ReachError(
        f"the axes of the passive joints are not known: {problem}",
        subject="[limits.passive_joints]",
        action="State base_axes and platform_axes there, or correct the points",
    )


def _unit(vectors: ArrayLike) -> Array:
    given = np.asarray(vectors, dtype=float)
    return np.asarray(given / np.linalg.norm(given, axis=-1, keepdims=True))


def stated_expansion(settings: CellSettings) -> ThermalExpansion:
    """How the parts of a cell's robot expand, and at which temperature its geometry is sought."""
    celsius, stated = settings.model.temperature_c, settings.uncertainty
    by_kelvin = stated.expansion_legs_um_m_k, stated.expansion_base_um_m_k
    return ThermalExpansion(*by_kelvin, (celsius,) * MEASURED_PARTS)


def stated_effects(
    settings: CellSettings, measured_range_k: float | None = None, known: Collection[MachinePart] = ()
) -> tuple[Effect, ...]:
    """All effects that the budget of a cell has lines for, also those of size zero.

    ``measured_range_k`` is the range of the temperatures read while measuring. The expansion of the parts
    that are ``known`` is out of the records, so that only what is not known of it acts.
    """
    stated, words, limits = settings.uncertainty, settings.mechanism.words, settings.limits

    def of(key: str, kind: Callable[[float], Effect]) -> Effect:
        """The effect whose size is under a key of the section."""
        return replace(kind(getattr(stated, key)), source=stated.source(key))

    effects: list[Effect] = []
    if isinstance(stated, uncertainty.LinearUncertaintySettings):
        effects.append(of("common_encoder_scale_um_m", effect_kinds.common_encoder_scale))
        # Where the scales are identified, what is not known of them is in the covariance of the parameters.
        if not settings.robot.encoder_scales:
            effects.append(of("encoder_scale_um_m", effect_kinds.encoder_scales))
    elif isinstance(stated, uncertainty.RotaryUncertaintySettings):
        effects.append(of("encoder_eccentricity_mdeg", effect_kinds.encoder_eccentricities))
    joint, unit, acts = words.joint, words.joint_unit, stated.stop_repeatability_acts
    stops = partial(effect_kinds.stop_repeatability, is_in_noise=acts == "at work", joint=joint, unit=unit)
    beside = effect_kinds.command_repeatability(1e3 * settings.noise.stops, joint=joint, unit=unit)
    effects.append(of(uncertainty.repeatability_key(unit), stops))
    effects.append(replace(beside, source=stated.sources.get(uncertainty.STOPS, "cell file")))
    if isinstance(stated, uncertainty.UncertaintySettings):
        half_mm, waves = 0.5 * (limits.joint_max - limits.joint_min), effect_kinds.rail_waves
        effects += [
            of("rail_direction_mrad", effect_kinds.rail_directions),
            of("rail_wave_short_um", partial(waves, wavelength_mm=stated.rail_wave_short_mm)),
            of("rail_wave_long_um", partial(waves, wavelength_mm=stated.rail_wave_long_mm)),
            of("rail_sag_um", partial(effect_kinds.common_sag, half_length_mm=half_mm)),
        ]
    expansion = {
        MachinePart.BASE: stated.expansion_base_um_m_k,
        MachinePart.PLATFORM: stated.expansion_platform_um_m_k,
        MachinePart.LEGS: stated.expansion_legs_um_m_k,
    }
    acting = {part: 0.0 if part in known else by_kelvin for part, by_kelvin in expansion.items()}
    warming = partial(effect_kinds.temperature_while_measuring, um_per_m_k=acting)
    measuring = of("temperature_measuring_k", warming)
    if measured_range_k is not None:
        measuring = replace(measuring, size=measured_range_k, source="thermometers")
    legs: list[Effect] = []
    if MachinePart.LEGS in known:
        of_legs, of_base = expansion[MachinePart.LEGS], expansion[MachinePart.BASE]
        expanding = partial(effect_kinds.expansion_coefficients, legs_um_m_k=of_legs, base_um_m_k=of_base)
        legs = [
            of("thermometers_k", partial(effect_kinds.thermometers_of_legs, um_per_m_k=of_legs)),
            of("expansion_percent", expanding),
        ]
    scales = effect_kinds.gauge_scales(1e3 * settings.noise.gauge_scale, is_estimated=True)
    yields = stated.leg_compliance_um_n
    sagging = partial(effect_kinds.own_weight, um_per_n=yields, weight=_stated_weight(settings))
    return (
        *effects,
        replace(scales, source="noise.gauge_scale"),
        of("ball_roundness_um", effect_kinds.ball_roundness),
        of("ball_beside_tool_mm", effect_kinds.ball_beside_tool),
        of("temperature_at_work_k", partial(effect_kinds.temperature_at_work, um_per_m_k=expansion)),
        measuring,
        *legs,
        of("load_n", partial(effect_kinds.load_at_work, um_per_n=yields)),
        of("own_weight_n", sagging),
    )


def _stated_weight(settings: CellSettings) -> Weight:
    """How the weight acts in the convention's frames; it is stated in the drawing's."""
    stated, frames = settings.uncertainty, settings.mechanism.normalize_frames(settings.drawing)[1]
    centre = stated.own_weight_centre_mm
    direction = frames.base @ _unit(stated.own_weight_direction)
    return Weight(direction, None if centre is None else frames.platform @ np.array(centre))


def stated_terms(settings: CellSettings) -> tuple[ModelTerm, ...]:
    """The terms beside the geometry that a cell's records are searched for."""
    machine = StatedMachine(
        settings.model.all_sizes,
        settings.mechanism.words.joint_unit,
        _stated_weight(settings),
        settings.uncertainty.own_weight_n,
    )
    made = (created(Group.TERMS, name, machine) for name in settings.model.terms)
    mean = np.zeros(settings.mechanism.joint_count)
    return tuple(replace(term, mean=mean) for term in made if term is not None)
