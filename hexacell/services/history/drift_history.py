"""The watch over all runs of a cell: what changed, when, and how near the sums are to an alarm."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.kinematics.parameters import GeometricParameter
from hexacell.runs.archived_documents import DocumentKind
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_index import EvidenceDocument, RunIndex
from hexacell.storage.atomic_files import sha256

if TYPE_CHECKING:
    from hexacell.drift.change_attribution import AttributedChange
    from hexacell.drift.drift_watch import StepAlarm, WatchResult

DAY_S = 86_400.0

LEAST_DAYS = 3.0
"""Between the first and the last of some runs: what they say of shorter times is not said of a month."""


@dataclass(frozen=True, slots=True)
class FoundChange:
    """A change that the watch found.

    Attributes:
        noticed: when the run ended that alarmed.
        after, before: when the runs ended between which it happened.
        parameter: the likeliest one of its leg, with its ``change`` and one standard deviation of that.
        per_day, sigma_per_day: by how much it has moved on since, until the next change; ``moves_on``:
            surely.
        possible_legs: of which one changed by all runs until the next change, the likeliest first; only
            one where that is certain.
        other_legs: that changed as well.
    """

    noticed: datetime
    after: datetime
    before: datetime
    possible_legs: tuple[int, ...]
    parameter: GeometricParameter
    change: float
    sigma: float
    per_day: float
    sigma_per_day: float
    moves_on: bool
    other_legs: tuple[int, ...]

    @property
    def leg(self) -> int:
        """The likeliest one."""
        return self.possible_legs[0]


@dataclass(frozen=True, slots=True)
class ParameterRate:
    """How fast a parameter changes steadily, if it alone does, in its unit a day; ``is_steady``: surely."""

    name: str
    unit: str
    per_day: float
    sigma_per_day: float
    is_steady: bool


@dataclass(frozen=True, slots=True)
class DriftHistory:
    """What all runs of a cell say of changes.

    Attributes:
        runs: when each run ended that counts, oldest first.
        celsius: the mean of the thermometers in each of them; none without.
        changes: oldest first.
        rates: since the last change, of the parameters that the runs see.
        shares: the cumulative sum of each parameter of the machine, as a share of its limit.
    """

    runs: tuple[datetime, ...]
    celsius: tuple[float | None, ...]
    changes: tuple[FoundChange, ...]
    shares: tuple[tuple[str, float], ...]
    rates: tuple[ParameterRate, ...] = ()


def drift_history(cell: Cell, index: RunIndex | None = None) -> DriftHistory:
    """The watch over the runs of a cell, since its file last stated other systematic effects.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    runs = _counted_runs(cell, index or RunIndex(cell))
    if not runs:
        return DriftHistory((), (), (), ())
    # Imported here: a cell without runs needs nothing of the watch.
    from hexacell.checks.change_alarm import machine_causes  # noqa: PLC0415
    from hexacell.drift.drift_watch import watch_runs  # noqa: PLC0415
    from hexacell.robot.model import robot_of  # noqa: PLC0415

    causes = machine_causes(robot_of(cell), len(runs[-1].evidence.weighted))
    days = [(run.at - runs[0].at).total_seconds() / DAY_S for run in runs]
    watched = watch_runs([run.evidence for run in runs], causes, days)
    parameters = cell.settings.mechanism.parameters
    ended = tuple(run.at for run in runs)
    changes = (
        _change(alarm, found, ended, parameters.parameters)
        for alarm, found in zip(watched.alarms, watched.attributed, strict=True)
    )
    shares = zip(parameters.names, watched.share_of_limit.tolist(), strict=True)
    return DriftHistory(
        ended,
        tuple(run.celsius for run in runs),
        tuple(changes),
        tuple(shares),
        _rates(parameters.parameters, runs, days, watched),
    )


def _rates(
    parameters: tuple[GeometricParameter, ...],
    runs: list[EvidenceDocument],
    days: list[float],
    watched: WatchResult,
) -> tuple[ParameterRate, ...]:
    """The rates that the runs since the last change see, if these span some days."""
    first = watched.since.first
    if days[-1] - days[first] < LEAST_DAYS:
        return ()
    from hexacell.drift.steady_drift import steady_drift_of_each  # noqa: PLC0415 - likewise

    found = steady_drift_of_each(watched.since.before, [run.evidence for run in runs[first:]], days[first:])
    is_steady = np.abs(found.scores) > found.limit
    numbers = zip(found.rates.tolist(), found.sigmas.tolist(), is_steady.tolist(), strict=True)
    return tuple(
        ParameterRate(one.name, one.kind.unit.value, *each)
        for one, each in zip(parameters, numbers, strict=True)
        if np.isfinite(each[1])
    )


def _counted_runs(cell: Cell, index: RunIndex) -> list[EvidenceDocument]:
    """The runs that have evidence of the same state as the latest, oldest first."""
    settings = cell.settings

    def read(folder: RunFolder) -> EvidenceDocument | None:
        from hexacell.services.history.run_evidence_document import evidence_document  # noqa: PLC0415

        return evidence_document(settings, folder)

    # What the noise or the effects are stated to be decides what the records say.
    deciding = {"robot", "noise", "uncertainty", "stations", "thermometers"}
    stated = sha256(settings.model_dump_json(include=deciding).encode())
    found = index.documents(DocumentKind.EVIDENCE, EvidenceDocument, read, context=stated[:16])
    runs = sorted(found.values(), key=lambda run: run.at)
    return [run for run in runs if len(run.weighted) == len(runs[-1].weighted)]


def _change(
    alarm: StepAlarm,
    found: AttributedChange,
    ended: tuple[datetime, ...],
    parameters: tuple[GeometricParameter, ...],
) -> FoundChange:
    return FoundChange(
        noticed=ended[alarm.run],
        after=ended[max(alarm.first - 1, 0)],
        before=ended[alarm.last],
        possible_legs=found.possible_legs,
        parameter=parameters[found.cause],
        change=found.change,
        sigma=found.sigma,
        per_day=found.rate,
        sigma_per_day=found.rate_sigma,
        moves_on=found.moves_on,
        other_legs=tuple(leg for leg in alarm.other_legs if leg not in found.possible_legs),
    )
