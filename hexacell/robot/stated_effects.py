"""The systematic effects of a robot: what its cell file states of them, as the mathematics takes it."""

from __future__ import annotations

from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import (
    CommonUncertaintySettings,
    LinearUncertaintySettings,
    RotaryUncertaintySettings,
    UncertaintySettings,
    repeatability_key,
)
from hexacell.kinematics.mechanism import MechanismWords
from hexacell.kinematics.parameters import MachinePart
from hexacell.uncertainty.effect_kinds import (
    ball_beside_tool,
    ball_roundness,
    common_encoder_scale,
    common_sag,
    encoder_eccentricities,
    encoder_scales,
    gauge_scales,
    load_at_work,
    rail_directions,
    rail_waves,
    stop_repeatability,
    temperature_at_work,
    temperature_while_measuring,
)
from hexacell.uncertainty.effects import Effect


def stated_effects(settings: CellSettings, measured_range_k: float | None = None) -> tuple[Effect, ...]:
    """All effects that the budget of a cell has lines for, also those of size zero.

    Only a mechanism with rails has those of rails.

    Args:
        settings: the cell's.
        measured_range_k: range of the temperatures read while measuring; None without thermometers.
    """
    stated = settings.uncertainty
    return (
        *_of_encoders(stated, are_identified=settings.robot.encoder_scales),
        _of_stops(stated, settings.mechanism.words),
        *_of_guides(stated, settings.limits.joint_max - settings.limits.joint_min),
        gauge_scales(1e3 * settings.noise.gauge_scale, is_estimated=True, source="noise.gauge_scale"),
        ball_roundness(stated.ball_roundness_um, stated.source("ball_roundness_um")),
        ball_beside_tool(stated.ball_beside_tool_mm, stated.source("ball_beside_tool_mm")),
        *_of_environment(stated, measured_range_k),
    )


def _of_encoders(stated: CommonUncertaintySettings, *, are_identified: bool) -> tuple[Effect, ...]:
    # Where the scales are identified, what is not known of them is in the covariance of the parameters.
    if isinstance(stated, LinearUncertaintySettings):
        common, each = "common_encoder_scale_um_m", "encoder_scale_um_m"
        of_each = encoder_scales(stated.encoder_scale_um_m, stated.source(each))
        return (
            common_encoder_scale(stated.common_encoder_scale_um_m, stated.source(common)),
            *(() if are_identified else (of_each,)),
        )
    if isinstance(stated, RotaryUncertaintySettings):
        key = "encoder_eccentricity_mdeg"
        return (encoder_eccentricities(stated.encoder_eccentricity_mdeg, stated.source(key)),)
    return ()


def _of_stops(stated: CommonUncertaintySettings, words: MechanismWords) -> Effect:
    key = repeatability_key(words.joint_unit)
    return stop_repeatability(
        getattr(stated, key),
        stated.source(key),
        is_in_noise=stated.stop_repeatability_acts == "at work",
        joint=words.joint,
        unit=words.joint_unit,
    )


def _of_guides(stated: CommonUncertaintySettings, range_mm: float) -> tuple[Effect, ...]:
    if not isinstance(stated, UncertaintySettings):
        return ()
    short, long = "rail_wave_short_um", "rail_wave_long_um"
    return (
        rail_directions(stated.rail_direction_mrad, stated.source("rail_direction_mrad")),
        rail_waves(stated.rail_wave_short_um, stated.rail_wave_short_mm, stated.source(short)),
        rail_waves(stated.rail_wave_long_um, stated.rail_wave_long_mm, stated.source(long)),
        common_sag(stated.rail_sag_um, 0.5 * range_mm, stated.source("rail_sag_um")),
    )


def _of_environment(
    stated: CommonUncertaintySettings, measured_range_k: float | None
) -> tuple[Effect, ...]:
    expansion = {
        MachinePart.BASE: stated.expansion_base_um_m_k,
        MachinePart.PLATFORM: stated.expansion_platform_um_m_k,
        MachinePart.LEGS: stated.expansion_legs_um_m_k,
    }
    change, source = stated.temperature_measuring_k, stated.source("temperature_measuring_k")
    if measured_range_k is not None:
        change, source = measured_range_k, "thermometers"
    return (
        temperature_at_work(
            stated.temperature_at_work_k, expansion, stated.source("temperature_at_work_k")
        ),
        temperature_while_measuring(change, expansion, source),
        load_at_work(stated.load_n, stated.leg_compliance_um_n, stated.source("load_n")),
    )
