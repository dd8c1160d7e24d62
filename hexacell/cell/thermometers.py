"""The section of the cell file that names a thermometer."""

from __future__ import annotations

from pydantic import Field

from hexacell.cell.base import Positive, Section


class ThermometerSettings(Section):
    """A thermometer at the machine or in the room; its readings are kept with every record."""

    name: str = Field(min_length=1, description="where it is: room, rails, platform")
    protocol: str = Field("sysfs", description="sysfs, or one that a plug-in adds")
    path: str = Field(
        min_length=1,
        description="sysfs: the file with the temperature in millidegrees, such as "
        "/sys/bus/w1/devices/28-.../temperature",
    )
    timeout_s: Positive = Field(2.0, description="longest wait for a reading")
