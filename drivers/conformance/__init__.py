"""What every gauge's driver must do, as tests: for those that come with the package, and for others.

A package that adds a gauge subclasses :class:`GaugeConformance` in its tests; pytest collects it. It runs
the driver against a twin of the instrument on a serial line: one that the package brings, or one of
:func:`served_twin`. A wire trace of a run becomes a test by :func:`recorded_line` and :func:`recorded_bus`.
"""

from drivers.conformance.gauges import GaugeConformance, GaugeTwin
from drivers.conformance.recorded_dialogue import DialogueDiffers
from drivers.conformance.recorded_lines import recorded_bus, recorded_line
from drivers.conformance.twins import served_twin

__all__ = [
    "DialogueDiffers",
    "GaugeConformance",
    "GaugeTwin",
    "recorded_bus",
    "recorded_line",
    "served_twin",
]
