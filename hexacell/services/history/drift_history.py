"""The watch over all runs of a cell: what changed, when, and how near the sums are to an alarm."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

from hexacell.cell.loader import Cell
from hexacell.drift.drift_watch import StepAlarm, watch_runs
from hexacell.kinematics.parameters import GeometricParameter
from hexacell.runs.run_folder import DocumentKind, RunFolder
from hexacell.services.history.run_index import EvidenceDocument, RunIndex
from hexacell.storage.atomic_files import sha256

MOVING_ON_RUNS = 30
"""Runs within which a leg that alarms again is said to have moved on."""


@dataclass(frozen=True, slots=True)
class FoundChange:
    """A change that the watch found.

    Attributes:
        noticed: when the run ended that alarmed.
        after, before: when the runs ended between which it happened.
        possible_legs: legs of which one changed, by all runs until the next change, the likeliest first;
            only one where that is certain.
        parameter: the likeliest one of its leg, with its ``change`` and one standard deviation of that.
        or_parameters: other parameters of that leg that the runs do not tell from it, with change and unit.
        other_legs: legs that changed as well.
        moved_again: how often the leg alarmed again, each time within ``MOVING_ON_RUNS`` of the last time.
        last_noticed: when the run ended that alarmed last.
    """

    noticed: datetime
    after: datetime
    before: datetime
    possible_legs: tuple[int, ...]
    parameter: GeometricParameter
    change: float
    sigma: float
    or_parameters: tuple[tuple[str, float, str], ...]
    other_legs: tuple[int, ...]
    moved_again: int
    last_noticed: datetime


@dataclass(frozen=True, slots=True)
class DriftHistory:
    """Changes of a robot, by all runs of its cell.

    Attributes:
        runs: when each run ended that counts, oldest first.
        celsius: the mean of the thermometers in each of them; None without thermometers.
        changes: oldest first.
        shares: the cumulative sum of each parameter of the machine, as a share of its limit.
    """

    runs: tuple[datetime, ...]
    celsius: tuple[float | None, ...]
    changes: tuple[FoundChange, ...]
    shares: tuple[tuple[str, float], ...]


def drift_history(cell: Cell, index: RunIndex | None = None) -> DriftHistory:
    """The watch over the runs of a cell, since its file last stated other systematic effects.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    if not (runs := _counted_runs(cell, index or RunIndex(cell))):
        return DriftHistory((), (), (), ())
    # Imported here: a cell without runs needs nothing of the watch.
    from hexacell.checks.change_alarm import machine_causes  # noqa: PLC0415
    from hexacell.robot.model import robot_of  # noqa: PLC0415

    causes = machine_causes(robot_of(cell), len(runs[-1].evidence.weighted))
    alarms, shares = watch_runs((run.evidence for run in runs), causes)
    parameters = cell.settings.mechanism.parameters
    ended = tuple(run.at for run in runs)

    def change(first: StepAlarm, *again: StepAlarm) -> FoundChange:
        others = {leg for alarm in (first, *again) for leg in alarm.other_legs}
        return FoundChange(
            noticed=ended[first.run],
            after=ended[max(first.first - 1, 0)],
            before=ended[first.last],
            possible_legs=first.possible_legs,
            parameter=parameters.parameters[first.cause],
            change=first.change,
            sigma=first.sigma,
            or_parameters=tuple(
                (parameters.names[one], size, parameters.parameters[one].kind.unit.value)
                for one, size in first.or_causes
            ),
            other_legs=tuple(sorted(others - set(first.possible_legs))),
            moved_again=len(again),
            last_noticed=ended[(first, *again)[-1].run],
        )

    return DriftHistory(
        ended,
        tuple(run.celsius for run in runs),
        tuple(change(*steps) for steps in _motions(alarms)),
        tuple(zip(parameters.names, shares.tolist(), strict=True)),
    )


def _motions(alarms: Iterable[StepAlarm]) -> list[list[StepAlarm]]:
    """Alarms, each with those by which its leg moved on."""
    motions: list[list[StepAlarm]] = []
    for alarm in alarms:
        moving = next((one for one in reversed(motions) if one[0].leg == alarm.leg), None)
        if moving is not None and alarm.run - moving[-1].run <= MOVING_ON_RUNS:
            moving.append(alarm)
        else:
            motions.append([alarm])
    return motions


def _counted_runs(cell: Cell, index: RunIndex) -> list[EvidenceDocument]:
    """The runs that have evidence of the same state as the latest, oldest first."""
    settings = cell.settings

    def read(folder: RunFolder) -> EvidenceDocument | None:
        from hexacell.services.history.run_summary import evidence_document  # noqa: PLC0415

        return evidence_document(settings, folder)

    # What the noise or the effects are stated to be decides what the records say.
    deciding = {"robot", "noise", "uncertainty", "stations", "thermometers"}
    stated = sha256(settings.model_dump_json(include=deciding).encode())
    found = index.documents(DocumentKind.EVIDENCE, EvidenceDocument, read, context=stated[:16])
    runs = sorted(found.values(), key=lambda run: run.at)
    return [run for run in runs if len(run.weighted) == len(runs[-1].weighted)]
