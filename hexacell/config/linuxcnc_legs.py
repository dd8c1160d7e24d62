"""Play and compliance of legs in LinuxCNC's files, for a kinematics component that corrects them.

    PLAY1 = 0.1                  setp hexaglidekins.play.0 0.1
    COMPLIANCE1 = 0.0003         setp hexaglidekins.compliance.0 0.0003
    WEIGHT = 100.0
    WEIGHT_DIRECTION_Z = -1.0    in the base frame
    WEIGHT_IN_MIDDLE = 0         0: in its centre, else in the middle of the joints on the platform
    WEIGHT_CENTRE_Z = 80.0       in the platform frame

Lengths are in the config's unit, compliance in that of length a newton, the weight in newtons. Where none
of the numbers is there no component reads them, and none is added; where some are, all must be.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, nan
from pathlib import Path
from typing import cast

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.config import interface
from hexacell.config.keyed_config import KeyedConfig, NumberLookup
from hexacell.kinematics.corrections import CorrectionKind, Corrections, Six, Three
from hexacell.kinematics.parameters import CONSTRAINTS

UM = 1e-3


@dataclass(frozen=True, slots=True)
class _Number:
    """What one number may be, in the unit of the corrections, of which the config's is a multiple."""

    lowest: float = -LARGEST_NUMBER
    highest: float = LARGEST_NUMBER
    unit: float = 1.0
    decimals: int = 6


def _numbers(unit_mm: float) -> Iterator[tuple[str, _Number]]:
    """The pins of the component, in the order of :meth:`LegCorrections._values`."""
    play = _Number(-interface.LARGEST_PLAY_MM, interface.LARGEST_PLAY_MM, unit_mm)
    compliance = _Number(0.0, interface.LARGEST_COMPLIANCE_UM_N, unit_mm / UM)
    yield from ((f"play.{leg}", play) for leg in range(CONSTRAINTS))
    yield from ((f"compliance.{leg}", compliance) for leg in range(CONSTRAINTS))
    yield "weight", _Number(0.0)
    yield from ((f"weight-direction.{axis}", _Number(decimals=9)) for axis in "xyz")
    yield "weight-in-middle", _Number(0.0, 1.0)
    yield from ((f"weight-centre.{axis}", _Number(unit=unit_mm)) for axis in "xyz")


class LegCorrections(KeyedConfig):
    """A config of LinuxCNC that may have these beside a geometry, or beside a part of it."""

    def read(self, text: str, source: Path | None) -> interface.ConfigPart:
        """As any keyed config, with play and compliance if the text has a place for them."""
        part, lookup = super().read(text, source), self._open(text, source)
        if not any(map(lookup.has, self._pins)):
            return part
        values = [self._number(lookup, key, source) for key in self._pins]
        legs, (weight, *direction, in_middle), centre = values[:12], values[12:17], values[17:]
        if not (length := hypot(*direction)):
            token = lookup.number(self._directions[0])
            raise interface.token_error(token, "the weight has no direction", source, "State it")
        found = Corrections(
            play_mm=cast("Six", tuple(legs[:CONSTRAINTS])),
            compliance_um_n=cast("Six", tuple(legs[CONSTRAINTS:])),
            weight_n=weight,
            weight_direction=cast("Three", tuple(one / length for one in direction)),
            weight_centre_mm=None if in_middle else cast("Three", tuple(centre)),
        )
        holds = frozenset({CorrectionKind.PLAY, CorrectionKind.COMPLIANCE})
        return replace(part, corrections=found, holds=holds)

    def rewrite(
        self, text: str, values: Mapping[str, float], corrections: Corrections | None = None
    ) -> str:
        """As any keyed config, with other numbers of these, if they are given and have a place."""
        new = super().rewrite(text, values)
        held = LegCorrections.read(self, new, None)
        if corrections is None or not held.holds:
            return new
        there, wanted = self._values(held.corrections), self._values(corrections)
        changed = {
            key
            for key, value in wanted.items()
            if not abs(there.get(key, nan) - value) <= 0.5 * 10.0 ** -self._pins[key].decimals
        }
        if changed & {*self._directions}:
            # A direction that is no unit vector in the text would change its meaning number by number.
            changed |= {*self._directions}
        lookup, tokens = self._open(new, None), dict[interface.NumberToken, str]()
        for key in changed:
            form = self._pins[key]
            tokens[lookup.number(key)] = interface.write_number(wanted[key], form.decimals, form.unit)
        return interface.replace_tokens(new, tokens)

    def _key_of_pin(self, pin: str) -> str:
        """The key of a pin of the component, by its name without that of the component."""
        raise NotImplementedError

    @cached_property
    def _pins(self) -> Mapping[str, _Number]:
        return {self._key_of_pin(pin): number for pin, number in _numbers(self._unit_mm)}

    @cached_property
    def _directions(self) -> tuple[str, ...]:
        return tuple(self._key_of_pin(f"weight-direction.{axis}") for axis in "xyz")

    def _number(self, lookup: NumberLookup, key: str, source: Path | None) -> float:
        token, number = lookup.number(key), self._pins[key]
        value = number.unit * interface.number_of(token, source)
        if not number.lowest <= value <= number.highest:
            limits = f"{number.lowest / number.unit:g} to {number.highest / number.unit:g}"
            raise interface.token_error(
                token, f"{key} is {token.text}", source, f"It must be from {limits}"
            )
        return value

    def _values(self, corrections: Corrections) -> Mapping[str, float]:
        """The numbers by their keys; without those of a centre that is not stated."""
        numbers = [*corrections.play_mm, *corrections.compliance_um_n, corrections.weight_n]
        numbers += [*corrections.weight_direction, float(corrections.weight_centre_mm is None)]
        return dict(zip(self._pins, [*numbers, *(corrections.weight_centre_mm or ())], strict=False))
