"""The config of a Hexaglide in the native format: one file."""

from hexacell.config.toml_format import native_layout
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS

NATIVE = native_layout(HEXAGLIDE_PARAMETERS)
