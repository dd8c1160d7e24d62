"""What all peers made of the same records, as one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from math import inf, isfinite
from typing import Any

import numpy as np

from tests.benchmarks.peers.interface import Ended
from tests.benchmarks.peers.robots import StudiedRobot

TOLERANCE_MM = 0.3
"""The bundled cell's, ``acceptance.position_mm``."""

WHOLE = 55
"""Records of the main comparison, as many as the bundled cell takes."""


class Way(StrEnum):
    """How poses were chosen."""

    CHOSEN = "chosen"
    RANDOM = "random"
    AIMED = "aimed"


@dataclass(frozen=True)
class Case:
    """One set of records: of which robot, how chosen, how many."""

    robot: int
    way: Way
    records: int


@dataclass(frozen=True)
class Result:
    """What a peer made of one set: errors at held-out poses, mm, infinite where it found nothing."""

    case: Case
    rms_mm: float
    largest_mm: float
    wall_s: float
    processor_s: float


@dataclass(frozen=True)
class Row:
    """A peer with sets of one way: medians over the robots, those without a solution among them.

    Attributes:
        needed: the smallest number of records from which on the largest error at held-out poses is within
            the tolerance for the median robot; 0: more than were tried.
    """

    peer: str
    way: Way
    robots: int
    failures: int
    rms_mm: float
    largest_mm: float
    needed: int
    wall_s: float
    processor_s: float
    peak_mb: float


@dataclass
class Comparison:
    """Rows as they come; ``absent`` says why a peer has none."""

    rows: list[Row] = field(default_factory=list)
    results: dict[str, list[Result]] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)

    def add(
        self, peer: str, cases: Sequence[Case], ended: Ended, robots: Mapping[int, StudiedRobot]
    ) -> None:
        """What a peer made of all cases."""
        if ended.absent:
            self.absent[peer] = ended.absent
            return
        found = []
        for case, one in zip(cases, ended.solved, strict=True):
            errors = robots[case.robot].errors_mm(one.geometry)
            rms = float(np.sqrt(np.mean(errors**2)))
            found.append(Result(case, rms, float(errors.max()), one.wall_s, one.processor_s))
        self.results[peer] = found
        self.rows += [_row(peer, way, found, ended.peak_mb) for way in Way]

    def lines(self) -> Iterator[str]:
        """The table, and who is not in it."""
        yield (
            f"{'':<20} {'poses':<7} {'failures':<9} {'rms mm':<8} {'largest':<8} "
            f"{'needed':<7} {'wall ms':<8} {'CPU ms':<8} peak MB"
        )
        for row in self.rows:
            yield (
                f"{row.peer:<20} {row.way:<7} {f'{row.failures} of {row.robots}':<9} {row.rms_mm:<8.4f} "
                f"{row.largest_mm:<8.4f} {row.needed or 'more':<7} {1e3 * row.wall_s:<8.0f} "
                f"{1e3 * row.processor_s:<8.0f} {row.peak_mb:.0f}"
            )
        for peer, reason in self.absent.items():
            yield f"{peer:<20} is not compared: {reason}"

    def document(self) -> dict[str, Any]:
        """All of it for JSON, where what is infinite is null."""
        return {
            "tolerance_mm": TOLERANCE_MM,
            "records": WHOLE,
            "rows": [_finite(asdict(row)) for row in self.rows],
            "results": {
                peer: [_finite(asdict(one)) for one in results] for peer, results in self.results.items()
            },
            "absent": self.absent,
        }


def _row(peer: str, way: Way, results: Sequence[Result], peak_mb: float) -> Row:
    mine = [one for one in results if one.case.way is way]
    whole = [one for one in mine if one.case.records == WHOLE]
    return Row(
        peer,
        way,
        len(whole),
        sum(one.rms_mm == inf for one in whole),
        float(np.median([one.rms_mm for one in whole])),
        float(np.median([one.largest_mm for one in whole])),
        _needed(mine),
        float(np.median([one.wall_s for one in whole])),
        float(np.median([one.processor_s for one in whole])),
        peak_mb,
    )


def _needed(results: Sequence[Result]) -> int:
    """See :class:`Row`: every larger set must be within the tolerance too."""
    needed = 0
    for size in sorted({one.case.records for one in results}, reverse=True):
        if np.median([one.largest_mm for one in results if one.case.records == size]) > TOLERANCE_MM:
            break
        needed = size
    return needed


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: None if isinstance(value, float) and not isfinite(value) else value
        for name, value in values.items()
    }
