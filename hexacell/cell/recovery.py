"""The section of the cell file on the handling of failures."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import NotNegative, Positive, Section, broken_rule


class Action(StrEnum):
    """How a failure is handled, the least severe action first.

    ``retry``: do the same again. ``measure-again``: reconnect the device if it was lost, return to the
    set's reference and, if the gauges kept their zero, take the record again. ``redo-set``: discard the
    set and measure it again. ``ask``: a person chooses. ``abort``: end the run.
    """

    RETRY = "retry"
    MEASURE_AGAIN = "measure-again"
    REDO_SET = "redo-set"
    ASK = "ask"
    ABORT = "abort"


class FailureKind(StrEnum):
    """Kinds of failure with a recovery of their own; the values are keys of the cell file."""

    GAUGE_SILENT = "gauge_silent"
    GAUGE_SETTING = "gauge_setting"
    GAUGE_AT_END = "gauge_at_end"
    MOUNTING = "mounting"
    UNSETTLED = "unsettled"
    ZERO_VOID = "zero_void"
    ENCODER_SILENT = "encoder_silent"
    ENCODER_ALARM = "encoder_alarm"
    ENCODER_RESTARTED = "encoder_restarted"
    CONTROLLER = "controller"
    LINK_LOST = "link_lost"
    DRIFT = "drift"
    NO_WAY = "no_way"
    GUARD = "guard"
    FILE = "file"
    OTHER = "other"
    FINAL = "final"
    """Trying again would not change it: a limit exceeded, an answer missing."""


Word = Literal["retry", "measure-again", "redo-set", "ask", "abort"]
Escalation = tuple[Word, ...]
"""How the first failure of a kind at a set is handled, the second, and so on; the last entry repeats."""

_ASK: tuple[Word, ...] = ("ask",)
_ABORT: tuple[Word, ...] = ("abort",)
_REDO: tuple[Word, ...] = ("redo-set", "redo-set", "abort")


class Escalations(Section):
    """One escalation a kind of failure. Each ends with ask or abort, so that attempts are bounded."""

    @model_validator(mode="after")
    def _every_escalation_ends(self) -> Self:
        for name, escalation in self:
            if not {*escalation[-1:]} & {"ask", "abort"}:
                raise broken_rule(f"{name} must end with ask or abort", "Append one of them")
        return self

    def action(self, kind: FailureKind, attempt: int) -> Action:
        """The action after the ``attempt``-th failure of a kind, counted from 1."""
        escalation: Escalation = getattr(self, kind.value, _ABORT)
        return Action(escalation[min(attempt, len(escalation)) - 1])


class AttendedRecovery(Escalations):
    """With a technician at the machine."""

    gauge_silent: Escalation = Field(_ASK, description="no answer, or an invalid one")
    gauge_setting: Escalation = Field(_ASK, description="inches, hold, a wrong mode, a low battery")
    gauge_at_end: Escalation = Field(_ASK, description="a plunger at an end of its travel at a reference")
    mounting: Escalation = Field(_ASK, description="gauges are not mounted as they must be")
    unsettled: Escalation = Field(_ASK, description="the readings did not settle")
    zero_void: Escalation = Field(_ASK, description="a gauge was switched off or set differently")
    encoder_silent: Escalation = Field(_ASK, description="a round of positions was not complete")
    encoder_alarm: Escalation = Field(_ASK, description="an encoder reports an error")
    encoder_restarted: Escalation = Field(_ASK, description="an encoder lost its configuration")
    controller: Escalation = Field(_ASK, description="the controller refused, or stopped at another place")
    link_lost: Escalation = Field(_ASK, description="a cable or connection broke")
    drift: Escalation = Field(_ASK, description="the reference is beyond acceptance.drift_mm at the end")
    no_way: Escalation = Field(_ASK, description="no safe path")
    guard: Escalation = Field(_ASK, description="a guard tripped")
    file: Escalation = Field(_ASK, description="a file could not be written or read")
    other: Escalation = Field(_ASK, description="any other failure of a device")


class UnattendedRecovery(Escalations):
    """Without a technician: a bounded number of attempts, then the run ends."""

    gauge_silent: Escalation = Field(("retry", *_REDO), description="no answer, or an invalid one")
    gauge_setting: Escalation = Field(_ABORT, description="inches, hold, a wrong mode, a low battery")
    gauge_at_end: Escalation = Field(
        ("redo-set", "abort"), description="a plunger at an end at a reference"
    )
    mounting: Escalation = Field(_ABORT, description="gauges are not mounted as they must be")
    unsettled: Escalation = Field(
        ("retry", "measure-again", "redo-set", "abort"), description="the readings did not settle"
    )
    zero_void: Escalation = Field(_REDO, description="a gauge was switched off or set differently")
    encoder_silent: Escalation = Field(
        ("retry", "measure-again", "measure-again", "abort"), description="a round was not complete"
    )
    encoder_alarm: Escalation = Field(
        ("measure-again", "measure-again", "abort"), description="an encoder reports an error"
    )
    encoder_restarted: Escalation = Field(_REDO, description="an encoder lost its configuration")
    controller: Escalation = Field(
        _ABORT, description="the controller refused, or stopped at another place"
    )
    link_lost: Escalation = Field(
        ("measure-again", "measure-again", "measure-again", "abort"),
        description="a cable or connection broke",
    )
    drift: Escalation = Field(_REDO, description="the reference is beyond acceptance.drift_mm at the end")
    no_way: Escalation = Field(("redo-set", "abort"), description="no safe path")
    guard: Escalation = Field(_ABORT, description="a guard tripped")
    file: Escalation = Field(_ABORT, description="a file could not be written or read")
    other: Escalation = Field(_ABORT, description="any other failure of a device")

    @model_validator(mode="after")
    def _never_asks(self) -> Self:
        for name, escalation in self:
            if "ask" in escalation:
                raise broken_rule(f"{name} asks, but the run is unattended", "Replace ask by abort")
        return self


class RecoverySettings(Section):
    """How failures and interruptions are handled."""

    agreement_mm: Positive = Field(
        0.05,
        description="largest change of a reference, gauges and encoders, with which a set continues, mm",
    )
    wait_s: NotNegative = Field(2.0, description="wait before a failed device is tried again, s")
    away_minutes: Positive = Field(
        30.0,
        description="minutes without anybody connected after which a run that waits for a person ends; "
        "it can be resumed",
    )
    attended: AttendedRecovery = AttendedRecovery()
    unattended: UnattendedRecovery = UnattendedRecovery()
