"""The config of a Hexaglide in the native format: one file."""

from hexacell.config.layout import ConfigLayout, FormatOfFile
from hexacell.config.toml_format import NativeToml
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS

NATIVE = ConfigLayout(HEXAGLIDE_PARAMETERS, (FormatOfFile("toml", NativeToml(HEXAGLIDE_PARAMETERS)),))
