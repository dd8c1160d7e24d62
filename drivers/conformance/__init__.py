"""What every driver must do, as tests: for those that come with the package, and for others.

A package that adds a gauge subclasses :class:`GaugeConformance` in its tests, one that adds encoders or a
controller :class:`EncoderConformance` or :class:`ControllerConformance`; pytest collects it. It runs the
driver against a twin of the device: one that the package brings, or one of :func:`served_twin` and
:func:`served_encoder_twin`. A wire trace of a run becomes a test by :func:`recorded_line` and
:func:`recorded_bus`.
"""

from drivers.conformance.controllers import ControllerConformance, ControllerTwin
from drivers.conformance.encoders import EncoderConformance, EncoderTwin, served_encoder_twin
from drivers.conformance.gauges import GaugeConformance, GaugeTwin, served_twin
from drivers.conformance.recorded_lines import DialogueDiffers, recorded_bus, recorded_line

__all__ = [
    "ControllerConformance",
    "ControllerTwin",
    "DialogueDiffers",
    "EncoderConformance",
    "EncoderTwin",
    "GaugeConformance",
    "GaugeTwin",
    "recorded_bus",
    "recorded_line",
    "served_encoder_twin",
    "served_twin",
]
