"""The section of the cell file on the handling of failures."""

from enum import StrEnum
from typing import Literal, Self

from pydantic import model_validator

from hexacell.cell.fields import NotNegative, Positive, Section, broken_rule, key


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
_AGAIN: tuple[Word, ...] = ("measure-again", "measure-again", "abort")


class Escalations(Section):
    """One escalation a kind of failure, which ends with ask or abort, so that attempts are bounded.

    A kind without one ends the run.
    """

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

    gauge_silent: Escalation = key(_ASK, "no answer, or an invalid one")
    gauge_setting: Escalation = key(_ASK, "inches, hold, a wrong mode, a low battery")
    gauge_at_end: Escalation = key(_ASK, "a plunger at an end of its travel at a reference")
    mounting: Escalation = key(_ASK, "gauges are not mounted as they must be")
    unsettled: Escalation = key(_ASK, "the readings did not settle")
    zero_void: Escalation = key(_ASK, "a gauge was switched off or set differently")
    encoder_silent: Escalation = key(_ASK, "a round of positions was not complete")
    encoder_alarm: Escalation = key(_ASK, "an encoder reports an error")
    encoder_restarted: Escalation = key(_ASK, "an encoder lost its configuration")
    controller: Escalation = key(_ASK, "the controller refused, or stopped at another place")
    link_lost: Escalation = key(_ASK, "a cable or connection broke")
    drift: Escalation = key(_ASK, "the reference is beyond acceptance.drift_mm at the end")
    no_way: Escalation = key(_ASK, "no safe path")
    guard: Escalation = key(_ASK, "a guard tripped")
    file: Escalation = key(_ASK, "a file could not be written or read")
    other: Escalation = key(_ASK, "any other failure of a device")


class UnattendedRecovery(Escalations):
    """Without a technician: a bounded number of attempts, then the run ends."""

    gauge_silent: Escalation = key(("retry", *_REDO), "no answer, or an invalid one")
    gauge_setting: Escalation = key(_ABORT, "inches, hold, a wrong mode, a low battery")
    gauge_at_end: Escalation = key(_REDO, "a plunger at an end at a reference")
    mounting: Escalation = key(_ABORT, "gauges are not mounted as they must be")
    unsettled: Escalation = key(
        ("retry", "measure-again", "redo-set", "abort"), "the readings did not settle"
    )
    zero_void: Escalation = key(_REDO, "a gauge was switched off or set differently")
    encoder_silent: Escalation = key(("retry", *_AGAIN), "a round was not complete")
    encoder_alarm: Escalation = key(_AGAIN, "an encoder reports an error")
    encoder_restarted: Escalation = key(_REDO, "an encoder lost its configuration")
    controller: Escalation = key(_ABORT, "the controller refused, or stopped at another place")
    link_lost: Escalation = key(("measure-again", *_AGAIN), "a cable or connection broke")
    drift: Escalation = key(_REDO, "the reference is beyond acceptance.drift_mm at the end")
    no_way: Escalation = key(("redo-set", "abort"), "no safe path")
    guard: Escalation = key(_ABORT, "a guard tripped")
    file: Escalation = key(_ABORT, "a file could not be written or read")
    other: Escalation = key(_ABORT, "any other failure of a device")

    @model_validator(mode="after")
    def _never_asks(self) -> Self:
        for name, escalation in self:
            if "ask" in escalation:
                raise broken_rule(f"{name} asks, but the run is unattended", "Replace ask by abort")
        return self


class RecoverySettings(Section):
    """How failures and interruptions are handled."""

    agreement_mm: Positive = key(
        0.05,
        "largest change of a reference, gauges and encoders, with which a set continues, mm; the measured "
        "noise may make it smaller or larger",
    )
    wait_s: NotNegative = key(2.0, "wait before a failed device is tried again, s")
    away_minutes: Positive = key(
        30.0,
        "minutes without anybody connected after which a run that waits for a person ends; it can be "
        "resumed",
    )
    attended: AttendedRecovery = AttendedRecovery()
    unattended: UnattendedRecovery = UnattendedRecovery()
