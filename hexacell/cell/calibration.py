"""Sections of the cell file: what a calibration measures and when its result is accepted."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import NotNegative, Point, Positive, Section, SixNumbers, broken_rule


class StationSettings(Section):
    """How the gauges are placed at each point."""

    alignment_deg: NotNegative = Field(
        0.3, description="angle between the gauges' axes and the base axes, deg, 1 sigma"
    )
    placement: Literal["by-hand", "fixed"] = Field(
        "by-hand", description="fixed: the gauges need no placing"
    )


class IdentificationSettings(Section):
    """Where the geometry is measured."""

    points: tuple[Point, ...] = Field(min_length=2, description="ball positions, mm, in this order")
    orientations: int = Field(11, ge=2, description="records at each point, its reference included")
    seed: int = Field(1, ge=0, description="random seed of the candidate orientations")
    criterion: Literal["task", "parameters", "information"] = Field(
        "information",
        description="what a pose reduces: the error at the task poses or of all parameters; or bits gained",
    )
    target_mm: Positive | None = Field(
        None, description="done when the predicted error at every task pose is below, 1 sigma"
    )
    least_gain_mm: NotNegative = Field(
        0.0, description="done when no record would lower that error by more"
    )
    budget_records: int | None = Field(None, ge=2, description="most records, references included")
    budget_minutes: Positive | None = Field(None, description="longest estimated time")
    minutes_per_station: NotNegative = Field(5.0, description="time to place the gauges at a point by hand")
    seconds_per_record: Positive | None = Field(
        None, description="to move and settle; by default from [timing]"
    )
    choose_points: bool = Field(
        False, description="true: visit the points with the largest gain per time, not all in order"
    )
    poses: str | None = Field(
        None, description="CSV file with the poses to visit (point,orientation,x,y,z,a,b,c)"
    )
    provisional: bool = Field(
        False, description="true: write a better geometry to the controller after the first point"
    )

    @model_validator(mode="after")
    def _points_are_chosen_or_listed(self) -> Self:
        if self.choose_points and self.poses is not None:
            raise broken_rule("a list of poses leaves no points to choose", "Remove one of the two")
        return self


class VerificationSettings(Section):
    """Where the result is validated: poses that are not in the fit."""

    points: tuple[Point, ...] = Field(min_length=1, description="ball positions, mm")
    orientations: int = Field(6, ge=2, description="poses at each point, its reference included")
    seed: int = Field(2, ge=0, description="random seed of the held-out orientations")


class AcceptanceSettings(Section):
    """When a result is good, and who approves writing it to the controller."""

    mean_deviation_mm: Positive = Field(0.05, description="at held-out points, after")
    max_deviation_mm: Positive = Field(0.15, description="at held-out points, after")
    largest_change_mm: Positive = Field(15.0, description="of a parameter, if no person approves")
    drift_mm: Positive = Field(0.1, description="of a point's reference, from its zeroing to its end")
    approval: Literal["ask", "automatic"] = Field(
        "ask", description="automatic: apply within the limits above without asking"
    )


class TaskSettings(Section):
    """The robot's task: poses for which its accuracy is predicted."""

    poses: tuple[SixNumbers, ...] = Field((), description="x y z a b c, mm and deg")
