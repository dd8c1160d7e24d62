"""The section of the cell file that says what follows a failure."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import NotNegative, Positive, Section, broken_rule


class Action(StrEnum):
    """What follows a failure.

    ``retry``: the same again. ``measure-again``: reopen the device if it is one that was lost,
    return to the set's reference and, if the gauges kept their zero, take the record again.
    ``redo-set``: give the set up and measure it anew. ``ask``: a person chooses. ``abort``: end.
    """

    RETRY = "retry"
    MEASURE_AGAIN = "measure-again"
    REDO_SET = "redo-set"
    ASK = "ask"
    ABORT = "abort"


class FailureKind(StrEnum):
    """Kinds of failure that may be answered differently; the values are keys of the cell file."""

    GAUGE_SILENT = "gauge_silent"
    GAUGE_SETTING = "gauge_setting"
    GAUGE_AT_END = "gauge_at_end"
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
    """Nothing that is done again would change it: a limit exceeded, an answer missing."""


Word = Literal["retry", "measure-again", "redo-set", "ask", "abort"]
Ladder = tuple[Word, ...]
"""What follows the first failure of a kind at a set, the second, and so on; the last word stays."""

_ASK: tuple[Word, ...] = ("ask",)
_ABORT: tuple[Word, ...] = ("abort",)
_REDO: tuple[Word, ...] = ("redo-set", "redo-set", "abort")


class _Ladders(Section):
    """One ladder a kind; each must end with an end, or it would be climbed for ever."""

    @model_validator(mode="after")
    def _every_ladder_ends(self) -> Self:
        for name, ladder in self:
            if not {*ladder[-1:]} & {"ask", "abort"}:
                raise broken_rule(f"{name} must end with ask or abort", "Append one of them")
        return self

    def ladder(self, kind: FailureKind) -> tuple[Action, ...]:
        """What follows failures of a kind, one after the other."""
        words: tuple[str, ...] = getattr(self, kind.value, _ABORT)
        return tuple(Action(word) for word in words)


class AttendedRecovery(_Ladders):
    """With a technician at the machine."""

    gauge_silent: Ladder = Field(_ASK, description="no answer, or none that makes sense")
    gauge_setting: Ladder = Field(_ASK, description="inches, hold, a wrong mode, a low battery")
    gauge_at_end: Ladder = Field(_ASK, description="a plunger at an end of its travel at a reference")
    unsettled: Ladder = Field(_ASK, description="the readings never came to rest")
    zero_void: Ladder = Field(_ASK, description="a gauge was off, or set differently, in between")
    encoder_silent: Ladder = Field(_ASK, description="a round of positions was not complete")
    encoder_alarm: Ladder = Field(_ASK, description="an encoder reports an error")
    encoder_restarted: Ladder = Field(_ASK, description="an encoder lost its configuration")
    controller: Ladder = Field(_ASK, description="the controller refused, or stopped elsewhere")
    link_lost: Ladder = Field(_ASK, description="a cable or connection broke")
    drift: Ladder = Field(_ASK, description="the reference is beyond acceptance.drift_mm at the end")
    no_way: Ladder = Field(_ASK, description="no checked straight line leads on")
    guard: Ladder = Field(_ASK, description="a guard tripped while the robot was watched")
    file: Ladder = Field(_ASK, description="a file could not be written or read")
    other: Ladder = Field(_ASK, description="any other failure of a device")


class UnattendedRecovery(_Ladders):
    """With nobody there: a bounded number of attempts, then the run ends."""

    gauge_silent: Ladder = Field(("retry", *_REDO), description="no answer, or none that makes sense")
    gauge_setting: Ladder = Field(_ABORT, description="inches, hold, a wrong mode, a low battery")
    gauge_at_end: Ladder = Field(("redo-set", "abort"), description="a plunger at an end at a reference")
    unsettled: Ladder = Field(
        ("retry", "measure-again", "redo-set", "abort"), description="the readings never came to rest"
    )
    zero_void: Ladder = Field(_REDO, description="a gauge was off, or set differently, in between")
    encoder_silent: Ladder = Field(
        ("retry", "measure-again", "measure-again", "abort"), description="a round was not complete"
    )
    encoder_alarm: Ladder = Field(
        ("measure-again", "measure-again", "abort"), description="an encoder reports an error"
    )
    encoder_restarted: Ladder = Field(_REDO, description="an encoder lost its configuration")
    controller: Ladder = Field(_ABORT, description="the controller refused, or stopped elsewhere")
    link_lost: Ladder = Field(
        ("measure-again", "measure-again", "measure-again", "abort"),
        description="a cable or connection broke",
    )
    drift: Ladder = Field(_REDO, description="the reference is beyond acceptance.drift_mm at the end")
    no_way: Ladder = Field(("redo-set", "abort"), description="no checked straight line leads on")
    guard: Ladder = Field(_ABORT, description="a guard tripped while the robot was watched")
    file: Ladder = Field(_ABORT, description="a file could not be written or read")
    other: Ladder = Field(_ABORT, description="any other failure of a device")

    @model_validator(mode="after")
    def _nobody_is_asked(self) -> Self:
        for name, ladder in self:
            if "ask" in ladder:
                raise broken_rule(f"{name} asks, and nobody is there", "Replace ask by abort")
        return self


class RecoverySettings(Section):
    """What follows a failure or an interruption."""

    agreement_mm: Positive = Field(
        0.05, description="largest change of a reference, gauges and sliders, with which a set goes on"
    )
    wait_s: NotNegative = Field(2.0, description="before a device that failed is tried again")
    attended: AttendedRecovery = AttendedRecovery()
    unattended: UnattendedRecovery = UnattendedRecovery()
