"""Sample: a record is taken, or rejected because the ball left the gauges' travel."""

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from drivers.errors import GaugeAtEnd
from hexacell.campaign.time_model import TimeKind
from hexacell.cell.model import CellSettings
from hexacell.errors import HexacellError, consists_only_of, joined
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import Deviation, Record
from hexacell.robot.stated import gauge_travel_of
from procedures.resources.run_resources import RunResources
from procedures.run.keys import ThreeNumbers
from procedures.run.readings import Reading, in_words
from procedures.run.state import RunState
from procedures.steps.base import EventAtPose, EventOfSet, StepAtPose
from procedures.steps.place import MountingError


class RecordTaken(EventAtPose):
    """A record was taken; ``deviation_mm`` is from the set's reference."""

    kind: Literal["sampled"] = "sampled"
    reading: Reading
    deviation_mm: ThreeNumbers

    @property
    def record(self) -> Record:
        """The record for the identification."""
        return record_of(self, self.reading, self.deviation_mm)

    def applied_to(self, state: RunState) -> RunState:
        measured = state.set(self.at)
        again = tuple(pair for pair in measured.again if pair[0] != self.orientation)
        samples = (*measured.samples, self)
        return state.with_changed_set(self.at, samples=samples, again=again, has_left=False)


class RecordRejected(EventOfSet):
    """A record was rejected: the ball left the travel. Its orientation is chosen again.

    There is no ``reading`` if a plunger was at its end, nor where a guard stopped the robot ``on_the_way``.
    """

    kind: Literal["refused"] = "refused"
    orientation: int
    reason: str
    reading: Reading | None = None
    on_the_way: bool = False

    def applied_to(self, state: RunState) -> RunState:
        """At the pose the ball was outside the travel, or a guard stopped the robot on the way to it."""
        rejected = state.set(self.at).with_rejection(self.orientation)
        left = state.without_position() if self.on_the_way else replace(state, at_pose=None)
        # With the new geometry it may be a verdict: that the gauges are as they were is verified first.
        is_verified = not self.at.phase.has_new_geometry or rejected.rejections > 1
        return left.with_set(self.at, rejected if is_verified else rejected.unverified())

    def text(self, state: RunState) -> str:
        return f"{self.at.pose_name(self.orientation)} left out: {self.reason}"


class Sample(StepAtPose):
    """Wait for settled readings and record them; the first of a set is the gauges' zero."""

    kind: Literal["sample"] = "sample"

    outcomes: ClassVar = (RecordTaken, RecordRejected)
    takes: ClassVar[TimeKind] = TimeKind.READING
    doing: ClassVar[str] = "reading, once the gauges have settled"

    def activity(self) -> None:
        """The run still does what its move began."""

    async def perform(self, run: RunResources, state: RunState) -> RecordTaken | RecordRejected:
        """Read as many windows as the measured noise asks for."""
        windows = 1 if state.noise is None else state.noise.noise.windows
        reading = await read_inside(self, run, state, windows)
        if isinstance(reading, RecordRejected):
            return reading
        zero = state.zero(self.at) or reading
        return RecordTaken(
            at=self.at,
            orientation=self.orientation,
            pose=self.pose,
            reading=reading,
            deviation_mm=reading.deviation_from(zero),
        )


def record_of(event: EventAtPose, reading: Reading, deviation_mm: Deviation) -> Record:
    """The record of what was read at a pose."""
    pose, joints = Pose(*event.pose), reading.joints
    point, orientation = event.at.point, event.orientation
    further = reading.directions, reading.part_temperatures, reading.at_s
    return Record(point, orientation, pose, joints, deviation_mm, *further)


async def read_inside(
    step: StepAtPose, run: RunResources, state: RunState, windows: int = 1
) -> Reading | RecordRejected:
    """Read with the ball inside the gauges' travel, or reject the record."""
    try:
        reading = await run.read(state, windows)
    except HexacellError as error:
        if not consists_only_of(error, GaugeAtEnd):
            raise
        return RecordRejected(at=step.at, orientation=step.orientation, reason=str(error))
    if (zero := state.zero(step.at)) is None:
        allowed_mm = run.calibration.known(state).allowances.mounting_mm(Pose(*step.pose))
        require_room(run.settings, reading.gauges_mm, allowed_mm)
        zero = reading
    deviation = reading.deviation_from(zero)
    room = gauge_travel_of(run.settings).room(zero.gauges_mm)
    if not room.holds(np.array(deviation)):
        reason = f"the ball is {in_words(deviation)} mm from its reference, farther than {room}"
        return RecordRejected(at=step.at, orientation=step.orientation, reason=reason, reading=reading)
    return reading


def require_room(settings: CellSettings, shown_mm: ThreeNumbers, allowed_mm: Array) -> None:
    """Raise ``MountingError`` for gauges whose plungers stand too far from the middle of their travel.

    ``shown_mm`` is what they show along base x, y, z, ``allowed_mm`` (3,) how far they may stand. A gauge
    whose display does not show its place passes.
    """
    errors: list[MountingError] = []
    travel = gauge_travel_of(settings)
    room, needed = travel.room(shown_mm), travel.sure_room
    gauges = sorted(settings.gauges, key=lambda gauge: gauge.axis)
    for axis, (gauge, place) in enumerate(zip(gauges, travel.places(shown_mm), strict=True)):
        if place is None or abs(place) <= allowed_mm[axis]:
            continue
        left = room.upper[axis] if place > 0.0 else -room.lower[axis]
        side = f"{'+' if place > 0.0 else '-'}{gauge.axis}"
        problem = (
            f"its plunger stands {abs(place):.1f} mm from the middle of its travel: {max(0.0, left):.1f} "
            f"mm are left towards {side}, where {needed.upper[axis]:g} are needed"
        )
        action = f"Move the gauge by {abs(place):.1f} mm along {side}, or correct its middle_mm"
        errors.append(MountingError(problem, subject=f"gauge {gauge.name}", action=action))
    if errors:
        raise joined("the gauges must be mounted again", errors)
