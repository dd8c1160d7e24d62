"""Effects of the gauges and the ball: scale, roundness, and a ball beside the tool's centre."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import UM, Effect, Occurrence, Placement, Readings


def gauge_scales(um_per_mm: float, *, is_estimated: bool, source: str = "") -> Effect:
    """Each gauge is wrong by a share of its own."""
    return Effect(
        "scale of each gauge",
        um_per_mm,
        "um/mm",
        Occurrence.MEASURING,
        on_readings=_scales,
        source=source,
        is_estimated=is_estimated,
    )


def ball_roundness(um: float, source: str = "") -> Effect:
    """The ball is oval: its radius differs from the mean by up to ``um``, in unknown directions."""
    return Effect("roundness of the ball", um, "um", Occurrence.MEASURING, on_readings=_oval, source=source)


def ball_beside_tool(mm: float, source: str = "") -> Effect:
    """The tool that works is not centred where the ball was, in any direction of the platform."""
    return Effect("ball beside the tool's centre", mm, "mm", Occurrence.WITH_TOOL, _beside, source=source)


def _scales(readings: Readings) -> Array:
    # Along the base axes, as the estimator has them: the gauges' own are within a degree of these.
    shares: Array = 1e-3 * readings.deviations[:, :, None] * np.eye(3)
    return shares


def _oval(readings: Readings) -> Array:
    """By each spherical harmonic of degree 2, the mean square of all five together being 1/2.

    The plate of a gauge touches the ball where its normal is the gauge's direction.
    """
    touched = np.swapaxes(readings.rotations, -1, -2) @ readings.gauges
    x, y, z = np.moveaxis(touched, -2, 0)
    harmonics = np.stack(
        [x * y, y * z, z * x, 0.5 * (x * x - y * y), (3.0 * z * z - 1.0) / np.sqrt(12.0)], axis=-1
    )
    amplitude = UM * np.sqrt(1.5)
    errors: Array = amplitude * np.einsum("ag,ngk->nak", readings.gauges, harmonics)
    return errors


def _beside(placement: Placement) -> Array:
    rotations = placement.poses.rotations
    return np.concatenate([rotations, np.zeros_like(rotations)], axis=1)
