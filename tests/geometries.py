"""Geometries of each mechanism from arrays of its kinds, mm, rad and deg."""

from functools import partial

from numpy.typing import ArrayLike

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.mechanisms.rotary_cranks import ROTARY_CRANKS_PARAMETERS
from hexacell.kinematics.mechanisms.six_rails import SIX_RAILS_PARAMETERS
from hexacell.kinematics.parameters import ParameterSet


def _geometry(parameters: ParameterSet, *arrays: ArrayLike, **named: ArrayLike) -> Geometry:
    """The arrays in the order of the kinds, or by their symbols."""
    return Geometry.of(parameters, dict(zip(parameters.shapes, arrays, strict=False)) | named)


gough_stewart_geometry = partial(_geometry, GOUGH_STEWART_PARAMETERS)
hexaglide_geometry = partial(_geometry, HEXAGLIDE_PARAMETERS)
rotary_cranks_geometry = partial(_geometry, ROTARY_CRANKS_PARAMETERS)
six_rails_geometry = partial(_geometry, SIX_RAILS_PARAMETERS)
