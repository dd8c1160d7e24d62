"""Effects of the guides: rails that are not parallel, not straight, or sag.

The kinematic model has all rails straight and parallel. A displacement of a slider across its rail moves
its joint, and the legs on the same rail have the same guide. A mechanism without rails has none of these
effects: their columns are zero in number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import UM, Effect, Occurrence, Placement


def rail_directions(mrad: float, source: str = "") -> Effect:
    """Each rail points elsewhere, horizontally and vertically."""
    columns = partial(_across_rails, shapes=lambda along: 1e-3 * along[..., None])
    return Effect("direction of each rail", mrad, "mrad", Occurrence.CONSTANT, columns, source=source)


def rail_waves(um: float, wavelength_mm: float, source: str = "") -> Effect:
    """Each rail is wavy with an amplitude and a wavelength, horizontally and vertically.

    The phase may be any; a sine and a cosine whose factors have the variance a^2 / 2 each have the same
    second moments.
    """

    def waves(along: Array) -> Array:
        phase = 2.0 * np.pi * along / wavelength_mm
        both: Array = UM / np.sqrt(2.0) * np.stack([np.sin(phase), np.cos(phase)], axis=-1)
        return both

    name = f"waves of the rails, {wavelength_mm:g} mm long"
    columns = partial(_across_rails, shapes=waves)
    return Effect(name, um, "um", Occurrence.CONSTANT, columns, source=source)


def common_sag(um: float, half_length_mm: float, source: str = "") -> Effect:
    """All rails hang through alike, as a parabola ``um`` deep with its ends ``half_length_mm`` away.

    Nothing that the gauges measure tells it from a slightly different geometry.
    """

    def sagging(placement: Placement) -> Array:
        if placement.guides is None:
            return np.zeros((len(placement), 6, 0))
        depth = UM * (placement.guides.along / half_length_mm) ** 2
        moved: Array = placement.by_constraints @ (placement.guides.across[..., 1] * depth)[..., None]
        return moved

    return Effect("sag common to all rails", um, "um", Occurrence.CONSTANT, sagging, source=source)


def _across_rails(placement: Placement, shapes: Callable[[Array], Array]) -> Array:
    """Errors by displacements of some shapes (n, 6, m) along the rails, each rail and direction alone."""
    guides = placement.guides
    if guides is None:
        return np.zeros((len(placement), 6, 0))
    on_rail = np.zeros((6, len(guides.rails)))
    for rail, legs in enumerate(guides.rails):
        on_rail[list(legs), rail] = 1.0
    columns = np.einsum("nid,nim,ir->nidmr", guides.across, shapes(guides.along), on_rail)
    moved: Array = placement.by_constraints @ columns.reshape(len(placement), 6, -1)
    return moved
