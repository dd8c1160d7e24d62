"""What an instrument is set to, as far as its protocol tells."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from drivers.gauges.shown import Unit


@dataclass(frozen=True, slots=True)
class GaugeState:
    """The settings that falsify readings if they are wrong, or the zero if they change.

    None where the protocol, or this instrument, does not say.
    """

    identification: str | None = None
    unit: Unit | None = None
    decimals: int | None = None
    mode: str | None = None
    hold: bool | None = None
    reversed: bool | None = None
    preset: str | None = None
    scaling: bool | None = None
    battery_low: bool | None = field(default=None, compare=False)

    def changes_since(self, before: GaugeState) -> tuple[str, ...]:
        """Each setting that differs from what was known ``before``, in words."""
        found = []
        for setting in fields(self):
            old, new = getattr(before, setting.name), getattr(self, setting.name)
            if setting.compare and old is not None and new is not None and old != new:
                found.append(f"{setting.name} {old} -> {new}")
        return tuple(found)
