"""The steps of a calibration: data, each with a stable key such as ``P2/o07/sample``."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from hexacell.campaign.decisions import Forecast
from hexacell.campaign.pilots import pilot_number
from hexacell.cell.fields import Frozen
from hexacell.kinematics.pose import Pose

SixNumbers = tuple[float, float, float, float, float, float]
ThreeNumbers = tuple[float, float, float]


class Phase(StrEnum):
    """What a set of poses is measured for; the value begins the keys of its steps."""

    IDENTIFY = "P"
    BEFORE = "before-V"
    AFTER = "after-V"
    CONFIRM = "confirm-V"
    LENGTH = "L"

    @property
    def has_new_geometry(self) -> bool:
        """Whether the held-out poses are commanded with the geometry that is to be verified."""
        return self in {Phase.AFTER, Phase.CONFIRM}


class SetKey(Frozen):
    """The poses at one point, measured with gauges zeroed once; points count from 1.

    In a length check a point is a mounting of the gauges; all have the zero of the first one.
    """

    phase: Phase
    point: int

    def __str__(self) -> str:
        return f"{self.phase.value}{self.point}"

    @property
    def station(self) -> str:
        """The same in words: where the gauges stand, and for what."""
        match self.phase:
            case Phase.BEFORE:
                return f"held-out point {self.point}"
            case Phase.AFTER:
                return f"held-out point {self.point} with the new geometry"
            case Phase.CONFIRM:
                return f"held-out point {self.point} with the new geometry, confirming records"
        return f"point {self.point}"


class Expectation(Frozen):
    """What the gauges should show (mm, base x y z), one sigma, and what is learnt (nat)."""

    deviation_mm: ThreeNumbers
    sigma_mm: ThreeNumbers
    gain: float
    forecast: Forecast | None = None


class BaseStep(Frozen):
    """A step; ``key`` is its stable name."""

    kind: str

    @property
    def key(self) -> str:
        """Stable name of the step."""
        return self.kind


class StepOfSet(BaseStep):
    """A step within a set."""

    at: SetKey

    @property
    def key(self) -> str:
        """Stable name of the step."""
        return f"{self.at}/{self.kind}"


class StepAtPose(StepOfSet):
    """A step at one pose of a set; the first orientation is its reference.

    Pilot poses have orientations that no record has (:mod:`hexacell.campaign.pilots`).
    """

    orientation: int
    pose: SixNumbers

    @property
    def key(self) -> str:
        """Stable name of the step."""
        pilot = pilot_number(self.orientation)
        pose = f"o{self.orientation:02d}" if pilot is None else f"pilot{pilot:02d}"
        return f"{self.at}/{pose}/{self.kind}"


class Locate(BaseStep):
    """Ask the controller for its pose: no path can be checked from an unknown one."""

    kind: Literal["locate"] = "locate"


class Move(StepAtPose):
    """Send the robot to a pose. Orientation 0 is a waypoint, at which nothing is measured.

    With ``from_elsewhere`` it comes from where the set's gauges are not, as to a set's first reference.
    """

    kind: Literal["move"] = "move"
    expected: Expectation | None = None
    from_elsewhere: bool = False

    @property
    def target(self) -> Pose:
        """Where to: the pose as the controller takes it."""
        return Pose(*self.pose)


class Place(StepOfSet):
    """Have the gauges put around the ball, plungers in the middle of their travel."""

    kind: Literal["place"] = "place"
    pose: SixNumbers


class Sample(StepAtPose):
    """Wait for settled readings and record them; the first of a set is the gauges' zero."""

    kind: Literal["sample"] = "sample"


class Revisit(StepOfSet):
    """Back at a set's reference after an interruption: see whether the gauges kept their zero."""

    kind: Literal["revisit"] = "revisit"


class CloseSet(StepOfSet):
    """Back at the set's reference pose: read again; the difference is drift.

    The ``reason`` is why the set has fewer records than planned; empty where it has all.
    """

    kind: Literal["close"] = "close"
    reason: str = ""


class Standstill(StepOfSet):
    """At a set's reference: read all devices again and again without moving, which shows their noise."""

    kind: Literal["standstill"] = "standstill"


class Pilot(StepAtPose):
    """Read the gauges where the reference was left: that steers the choice of poses, and nothing else."""

    kind: Literal["pilot"] = "pilot"


class Repeat(StepOfSet):
    """Back at a set's reference from another direction: read again, which shows how well it repeats."""

    kind: Literal["repeat"] = "repeat"


class Probe(StepOfSet):
    """Beside a set's reference, after a small known move of the ball: read the gauges."""

    kind: Literal["probe"] = "probe"
    moved_mm: ThreeNumbers


class Try(StepOfSet):
    """Back at a set's reference: judge whether the gauges followed the ball."""

    kind: Literal["try"] = "try"


class Compute(BaseStep):
    """A step that moves nothing."""

    kind: Literal[
        "assess noise",
        "lend",
        "take back",
        "identify",
        "propose",
        "commit",
        "judge",
        "accept",
        "roll back",
    ]


Step = Annotated[
    Locate
    | Move
    | Place
    | Sample
    | Revisit
    | CloseSet
    | Standstill
    | Pilot
    | Repeat
    | Probe
    | Try
    | Compute,
    Field(discriminator="kind"),
]
