"""The JSON documents that commands print for programs (``docs/interface.md``).

Moments, paths, dataclasses and models in them become JSON where they are printed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hexacell.campaign.decisions import Finished, StartPoint
from hexacell.text.verdict import teaching_sentence

if TYPE_CHECKING:
    from drivers.interfaces import DeviceIdentity
    from hexacell.dry_run.campaign import QuickTrial
    from hexacell.results.run_comparison import ParameterTrend, RunComparison
    from hexacell.runs.run_folder import RunFolder
    from hexacell.services.history.drift_history import DriftHistory, FoundChange
    from hexacell.services.history.past_runs import Retention
    from hexacell.services.history.run_index import PastRun, RunSummary
    from hexacell.services.offline import NextPose, PlanTrial
    from hexacell.services.run.calibration_run import RunRequest
    from hexacell.services.unattended.schedules import Schedule
    from hexacell.services.write_back.config_history import ConfigHistory, ConfigWrite
    from hexacell.services.write_back.config_rollback import ConfigRollback
    from hexacell.services.write_back.proposals import AppliedProposal
    from procedures.journal.journal import Entry
    from procedures.replay.replayer import ReplayReport
    from procedures.run.state import RunState
    from procedures.steps import events


def next_document(proposed: NextPose) -> dict[str, Any]:
    """What ``next --json`` prints."""
    decision, forecast = proposed.decision, proposed.forecast
    now = {
        "left_out": proposed.left_out,
        "present_worst_sigma_mm": forecast and forecast.now_mm,
        "present_expanded_mm": forecast and forecast.expanded_mm(forecast.now_mm),
    }
    if isinstance(decision, Finished):
        return {"done": True, "reason": decision.reason, **now}
    if isinstance(decision, StartPoint):
        zero = [0.0, 0.0, 0.0]
        found = {"predicted_deviation": zero, "sigma": zero, "gain": 0.0, "via": []}
        record = {"orientation": 1, "reference": True, **found}
    else:
        record = {
            "orientation": decision.orientation,
            "reference": False,
            "predicted_deviation": decision.deviation,
            "sigma": decision.sigma,
            "gain": decision.gain,
            "via": decision.via,
        }
    return {
        "done": False,
        **now,
        "point": decision.point,
        **record,
        "pose": decision.pose,
        "joint_targets": decision.joints,
        "predicted_worst_sigma_mm": forecast and forecast.next_mm,
        "going_on": forecast
        and {
            "records": forecast.records,
            "minutes": forecast.minutes,
            "worst_sigma_mm": forecast.end_mm,
            "expanded_mm": forecast.expanded_mm(forecast.end_mm),
            "gain_mm": forecast.gain_mm,
        },
    }


def preflight_document(devices: Sequence[DeviceIdentity], trial: PlanTrial) -> dict[str, Any]:
    """What ``preflight --json`` prints."""
    expected = {
        **asdict(trial.result),
        "averaging": trial.averaging,
        "encoders_part_mm": trial.encoders_part_mm,
        "lost": trial.unreachable,
    }
    return {"ready": True, "devices": devices, "expected": expected}


def quick_preflight_document(devices: Sequence[DeviceIdentity], trial: QuickTrial) -> dict[str, Any]:
    """What ``preflight --mode quick --json`` prints."""
    expected = {"points": trial.points, "minutes": trial.minutes, "quick": trial.accuracy}
    return {"ready": True, "devices": devices, "expected": expected}


def run_document(request: RunRequest, ended: events.Ended, state: RunState) -> dict[str, Any]:
    """What ``run --json`` and ``demo --json`` print."""
    judged, noise, found = state.judged, state.noise, state.identified
    measurements, moved = request.folder.measurements, ended.displacement
    return {
        "exit_code": ended.exit_code,
        "line": ended.line,
        "verdict": judged and judged.verdict,
        "verification": judged and judged.verification,
        "check": judged and judged.check,
        "quick": found and found.quick,
        "length": judged and judged.length,
        "measured_noise": noise and noise.noise,
        "displacement": moved,
        "teaching": moved and teaching_sentence(moved),
        "run": request.folder.path,
        "measurements": measurements if measurements.is_file() else None,
        "config": request.cell.config_path,
    }


def replay_document(replayed: ReplayReport) -> dict[str, Any]:
    """What ``replay --json`` prints."""
    return {
        "same": replayed.is_same,
        "journal": replayed.journal,
        "events": replayed.events,
        "decisions": replayed.decisions,
        "results": replayed.results,
        "taken": replayed.taken,
        "recorded_by": replayed.recorded_by,
        "replayed_by": replayed.replayed_by,
        "differences": [
            {"line": one.line, "place": one.place, "aspect": one.aspect}
            | {"counts": replayed.counts(one), **asdict(one.change)}
            for one in replayed.differences
        ],
    }


def applied_document(applied: AppliedProposal) -> dict[str, Any]:
    """What ``apply --json`` prints."""
    change, moved = applied.proposal.change, applied.proposal.displacement
    return {
        "applied": bool(applied.by),
        "by": applied.by or None,
        "config": change.path,
        "further_configs": change.paths[1:],
        "run": applied.proposal.folder.path,
        "sha256": change.sha256_after,
        "teach": teaching_sentence(moved) or None,
        "recorded": not applied.unrecorded,
    }


def rollback_document(done: ConfigRollback) -> dict[str, Any]:
    """What ``rollback --json`` prints."""
    return {
        "restored": bool(done.change),
        "config": done.paths[0],
        "further_configs": done.paths[1:],
        "from": done.restored[0],
        "undone": done.undone,
        "recorded": not done.unrecorded,
    }


def config_history_document(found: ConfigHistory) -> dict[str, Any]:
    """What ``history --changes --json`` prints: the writes, the newest first."""
    return {"changes": [_write_document(one) for one in found.writes], "damaged_lines": found.damaged}


def _write_document(write: ConfigWrite) -> dict[str, Any]:
    one = write.record
    known = one.model_dump(exclude={"version", "files", "why"})
    return {
        **{name: None if value == "" else value for name, value in known.items()},
        "config": one.files[0],
        "further_configs": one.files[1:],
        "verdict": write.verdict,
        "why": write.why or None,
        "recorded": write.is_recorded,
    }


def history_document(runs: Sequence[PastRun]) -> dict[str, Any]:
    """What ``history --json`` prints: the runs, the newest first."""
    return {
        "runs": [
            {"run": one.folder.path, "in_controller": one.is_in_controller, **summary_document(one.summary)}
            for one in runs
        ]
    }


def summary_document(was: RunSummary) -> dict[str, Any]:
    """What a run was and found."""
    position = was.position
    return {
        "began": was.began,
        "ended": was.ended,
        "mode": was.mode or None,
        "records": was.records,
        "verdict": was.verdict,
        "position_mm": position and position.value,
        "expanded_mm": position and position.expanded,
        "limit_mm": position and position.limit,
        "line": was.line,
        "begun": was.has_begun,
        "over": was.is_over,
        "written": was.has_written,
        "proposal": was.has_proposal,
    }


def comparison_document(before: RunFolder, after: RunFolder, compared: RunComparison) -> dict[str, Any]:
    """What ``history --compare --json`` prints."""
    return {
        "before": before.path,
        "after": after.path,
        "frame": compared.frame,
        "changed": compared.is_changed,
        "chi2": compared.test.chi2,
        "dof": compared.test.expected,
        "probability": compared.test.probability,
        "parameters": [
            {**asdict(one), "change": one.change, "significant": one.is_significant}
            for one in compared.parameters
        ],
    }


def drift_document(found: Sequence[ParameterTrend], watched: DriftHistory) -> dict[str, Any]:
    """What ``history --drift --json`` prints."""
    return {
        "parameters": [{**asdict(one), "walking": one.is_walking} for one in found],
        "runs": watched.runs,
        "temperatures_c": watched.celsius,
        "changes": [_change_document(one) for one in watched.changes],
        "shares_of_limit": dict(watched.shares),
    }


def _change_document(found: FoundChange) -> dict[str, Any]:
    parameter = {"parameter": found.parameter.name, "unit": found.parameter.kind.unit}
    return asdict(found) | {"leg": found.leg, **parameter}


def schedule_document(schedule: Schedule | None) -> dict[str, Any]:
    """What ``schedule --json`` prints."""
    return {
        "unit": schedule and schedule.unit,
        "files": schedule.files if schedule else [],
        "complaints": schedule.complaints if schedule else [],
    }


def retention_document(found: Retention, *, is_deleted: bool) -> dict[str, Any]:
    """What ``history --keep --json`` prints."""
    return {
        "before": found.before,
        "deleted": is_deleted,
        "runs": [run.folder.path for run in found.leaving],
        "kept": [{"run": run.folder.path, "reason": reason} for run, reason in found.kept],
    }


def story_document(entries: Sequence[Entry]) -> dict[str, Any]:
    """What ``history --show --json`` prints."""
    from hexacell.text.line_face import run_story  # noqa: PLC0415 - needs the words of all events

    return {
        "events": [
            {"line": entry.number, "at": entry.at, "kind": entry.event.kind, "text": text}
            for entry, text in run_story(entries)
        ]
    }
