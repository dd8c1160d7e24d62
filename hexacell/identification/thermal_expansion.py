"""Records of a machine that became warmer, as those of the geometry at one temperature.

A leg of length l is longer by ``a l (T - T0)`` where its temperature is T and the geometry is that at T0.
Where the base, with the encoders' scales and the gauges on it, has become larger by a share, every length
that it is measured by has, so that it is the legs that are shorter by this share. A joint variable changed
by what does the same to its leg's constraint, to first order, is the one that the leg would have had at T0
with the platform at the same pose. Second order is below a millionth of the change of length.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.placement import Placement
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MEASURED_PARTS, MeasurementSet, Temperatures, temperatures_of

UM_PER_M = 1e-6
"""A relative expansion."""

BASE = MEASURED_PARTS - 1
"""The last of the temperatures; those of legs that a machine does not have are not known."""

MOST_GAPS = 0.1
"""Share of the records at which a thermometer may be silent: between others it is known well enough."""


@dataclass(frozen=True, slots=True)
class ThermalExpansion:
    """How legs and base expand, and the temperature of each at which the geometry is sought.

    Attributes:
        legs_um_m_k, base_um_m_k: thermal expansion, um/m/K.
        reference_c: of legs 1 to 6 and of the base, deg C; None: that of the first record, in the
            order of a measurement set, that has one.
    """

    legs_um_m_k: float = 0.0
    base_um_m_k: float = 0.0
    reference_c: Temperatures = (None,) * MEASURED_PARTS

    def referred_to(self, measured: MeasurementSet) -> "ThermalExpansion":
        """With the temperatures of the first records where none is stated."""
        columns = [shown[np.isfinite(shown)].tolist() for shown in measured.temperatures.T]
        pairs = zip(self.reference_c, columns, strict=True)
        first = (column[0] if stated is None and column else stated for stated, column in pairs)
        return replace(self, reference_c=tuple(first))

    def holds_at(self, measured: MeasurementSet) -> Temperatures:
        """The temperatures for which these records show the geometry; None of a part that has none."""
        pairs = zip(self.referred_to(measured).reference_c, measured.temperatures.T, strict=True)
        return tuple(celsius if np.isfinite(shown).any() else None for celsius, shown in pairs)

    def warmer(self, measured: MeasurementSet) -> Array:
        """By how much legs and base (n, 7), K, are warmer at n records than the geometry's.

        Where some records have no temperature, it is between those before and after. A leg that none has a
        temperature of is like the base, which is as before where none has one.
        """
        rows, reference = np.arange(len(measured)), self.holds_at(measured)
        warmer = np.zeros((len(measured), MEASURED_PARTS))
        like_base = self.base_um_m_k / self.legs_um_m_k if self.legs_um_m_k else 0.0
        for part, shown in reversed([*enumerate(measured.temperatures.T)]):
            known, celsius = np.isfinite(shown), reference[part]
            if celsius is not None:
                warmer[:, part] = np.interp(rows, rows[known], shown[known]) - celsius
            else:
                warmer[:, part] = like_base * warmer[:, -1]
        return warmer

    def joints_without(self, at: Placement, warmer: Array) -> Array:
        """The joint variables (n, 6) that parts not ``warmer`` (n, 7), K, would have at the same poses."""
        if not warmer.any():
            return at.joints
        legs = at.joints.shape[1]
        longer = self.legs_um_m_k * warmer[:, :legs] - self.base_um_m_k * warmer[:, BASE:]
        return np.asarray(at.joints + at.as_joints(longer_legs(at, longer)))


def longer_legs(at: Placement, um_per_m: float | Array) -> Array:
    """Errors (n, J), mm, of the legs' constraints by legs that are longer by some shares (n, J)."""
    parameters = at.mechanism.parameters
    expands = {kind.symbol: float(kind.part is MachinePart.LEGS) for kind in parameters.kinds}
    lengths = parameters.by_constraint(parameters.by_kind(expands) * at.geometry.vector)
    by_leg = np.einsum("nic,ic->ni", at.derivatives.parameters, lengths)[:, : at.joints.shape[1]]
    return np.asarray(UM_PER_M * um_per_m * by_leg)


def known_parts(rows: Iterable[Temperatures], legs: int) -> frozenset[MachinePart]:
    """The parts, of all legs and the base beside them, whose temperature (nearly) all of n records have."""
    unknown = np.isnan(temperatures_of(rows))
    is_known = unknown.mean(axis=0) <= MOST_GAPS if len(unknown) else np.zeros(MEASURED_PARTS, dtype=bool)
    if not is_known[:legs].all():
        return frozenset()
    return frozenset({MachinePart.LEGS, *([MachinePart.BASE] if is_known[BASE] else [])})
