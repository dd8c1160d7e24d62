"""Section of the cell file on the limits of motion: of commands, joint variables, joints and legs."""

from functools import partial
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from hexacell.cell.fields import (
    Direction,
    InRange,
    NotNegative,
    Positive,
    Section,
    Six,
    SixInRange,
    Text,
    broken_rule,
    key,
    outside,
)
from hexacell.kinematics.commanded_motion import RefusedCommand

MOST_EXCLUSIONS = 100

NEAR_MM = 30.0
"""Default of ``within_mm``: the errors of the geometry put a command some 10 mm from its point at most."""

NEAR_DEG = 5.0


def _ordered(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] >= limits[1]:
        raise broken_rule("the smallest value must be below the largest", "Exchange or correct them")
    return limits


def _of_all_or_of_each(given: Any, count: int) -> Any:  # noqa: ANN401 - what pydantic hands on
    each = given if isinstance(given, list | tuple) else [given] * count
    if len(each) != count or not all(type(one) in {int, float} and 0 < one <= 180 for one in each):
        raise outside(f"an angle above 0, to 180, or a list of {count} of them, one a leg")
    return tuple(given) if isinstance(given, list) else given


MinMax = Annotated[tuple[InRange, InRange], AfterValidator(_ordered)]
Cone = Annotated[float, Field(gt=0, le=180)]
Cones = Annotated[Cone | Six[Cone], BeforeValidator(partial(_of_all_or_of_each, count=6))]


class AxisLimitSettings(Section):
    """Smallest and largest command of each of the controller's axes; None: any."""

    x: MinMax | None = key(None, "smallest and largest command, mm")
    y: MinMax | None = key(None, "smallest and largest command, mm")
    z: MinMax | None = key(None, "smallest and largest command, mm")
    a: MinMax | None = key(None, "smallest and largest command, deg")
    b: MinMax | None = key(None, "smallest and largest command, deg")
    c: MinMax | None = key(None, "smallest and largest command, deg")

    @property
    def ranges(self) -> tuple[MinMax | None, ...]:
        """The limits of the six axes in their order."""
        return (self.x, self.y, self.z, self.a, self.b, self.c)


class PassiveJointSettings(Section):
    """How far each leg may turn in its two passive joints, from the joint's axis."""

    base_cone_deg: Cones = key(
        180.0, "half angle of the cone at the base's end of each leg, deg; one for all or a list; 180: any"
    )
    platform_cone_deg: Cones = key(
        180.0, "half angle of the cone at the platform, deg; one for all legs or a list; 180: any"
    )
    base_axes: Six[Direction] | None = key(
        None,
        "axes of the cones in the base frame of the drawing, from the platform to the base; by default "
        "each leg's direction at the middle of all points, untilted. On a crank: in its own frame, x "
        "along the crank and z along its axis",
    )
    platform_axes: Six[Direction] | None = key(
        None,
        "axes of the cones at the platform, in the platform frame of the drawing; by default as base_axes",
    )


class ExclusionSettings(Section):
    """What the robot must not be sent to: a point as a whole, or a pose with all commands near it."""

    point: Annotated[int, Field(ge=1)] | None = key(
        None, "number of a point of [identification], from 1, that is not measured"
    )
    pose: SixInRange | None = key(
        None, "x, y, z, a, b, c in the controller's frames, mm and deg, that is never commanded"
    )
    within_mm: NotNegative = key(
        NEAR_MM,
        "distance from the pose, mm, within which no command goes if its angle is within within_deg, too",
    )
    within_deg: NotNegative = key(
        NEAR_DEG, "angle from the pose, deg, within which no command goes; 0: this pose alone is excluded"
    )

    @model_validator(mode="after")
    def _names_a_point_or_a_pose(self) -> Self:
        if (self.point is None) == (self.pose is None):
            raise broken_rule("an exclusion is of a point or of a pose", "State one of point and pose")
        return self

    @property
    def refused(self) -> RefusedCommand | None:
        """The excluded commands; None for a point as a whole."""
        if self.pose is None:
            return None
        return RefusedCommand(self.pose, within_mm=self.within_mm, within_deg=self.within_deg)


class LimitSettings(Section):
    """Limits of every commanded pose, and of the way to it."""

    gauge_travel_mm: Positive = key(5.0, "largest deviation of the ball from the zeroed reference, mm")
    tilt_deg: Positive = key(45.0, "largest tilt of the platform, deg", le=80)
    turn_deg: Positive = key(180.0, "largest turn of the platform about its normal, deg", le=180)
    joint_min: InRange = key(-1000.0, "smallest joint variable of any leg", alias="joint_min_mm")
    joint_max: InRange = key(1000.0, "largest joint variable of any leg", alias="joint_max_mm")
    joints: Six[MinMax] | None = key(
        None,
        "smallest and largest joint variable of each leg, where they differ; those of all legs hold as "
        "well",
        alias="joints_mm",
    )
    axes: AxisLimitSettings = AxisLimitSettings()
    ini: Text | None = key(
        None,
        "LinuxCNC's INI file, relative to the cell file: its limits of axes and joints hold as well",
        min_length=1,
    )
    passive_joints: PassiveJointSettings = PassiveJointSettings()
    leg_distance_mm: NotNegative = key(
        0.0, "smallest distance of two legs, from middle line to middle line, mm; 0: any"
    )
    singularity_margin: Positive = key(0.03, "smallest singular value of the dimensionless pose Jacobian")

    @model_validator(mode="after")
    def _joint_limits_are_ordered(self) -> Self:
        if self.joint_min >= self.joint_max:
            low, high = self.key("joint_min"), self.key("joint_max")
            raise broken_rule(f"{low} must be below {high}", "Exchange or correct them")
        return self


class MotionSettings(Section):
    """How stops are reached."""

    approach: Literal["any", "one-sided"] = key(
        "any",
        "from which side joints arrive at a stop: any, or always the same, by an overshoot before it, so "
        "that backlash drops out; the robot at work must then be approached in the same way",
    )
    direction: Literal["positive", "negative"] = key(
        "positive", "the direction in which every joint arrives where the approach is one-sided"
    )

    @property
    def sign(self) -> Literal[-1, 0, 1]:
        """The direction in which every joint is to arrive, 1 or -1; 0 for any."""
        if self.approach == "any":
            return 0
        return 1 if self.direction == "positive" else -1


class SpeedSettings(Section):
    """The largest speeds of a move; from the stricter of two, each move gets its duration."""

    joint: Positive = key(100.0, "largest speed of any joint variable", alias="joint_mm_s")
    edge_mm_s: Positive = key(100.0, "largest speed of the ball and of any joint of the platform, mm/s")
    joint_at_gauges: Positive = key(
        25.0,
        "largest speed of any joint variable on a move that begins or ends with gauges at the ball",
        alias="joint_at_gauges_mm_s",
    )
    edge_at_gauges_mm_s: Positive = key(
        25.0, "largest speed of the ball and of any joint of the platform on such a move, mm/s"
    )
