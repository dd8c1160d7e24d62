"""What happened: the journal's records, from which everything else is derived.

Raw readings do not depend on any geometry: encoder counts and gauge answers as they came, the pose
commanded, and in ``RunStarted`` the geometry that commanded it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from hexacell.cell.base import GeometryValues
from hexacell.controller_config.format import Branch
from hexacell.verification import Verdict
from procedures.steps import Frozen, SetKey, SixNumbers, Step, ThreeNumbers


class Identity(Frozen):
    """A device that answered when the run began."""

    name: str
    protocol: str
    description: str
    serial_number: str = ""


class RunStarted(Frozen):
    """The run's first record."""

    kind: Literal["started"] = "started"
    software: str
    cell: str
    cell_text: str
    mode: Literal["check", "optimise"]
    config: str
    config_sha256: str
    controller: GeometryValues
    branch: Branch
    devices: tuple[Identity, ...]


class StepBegun(Frozen):
    """A step was decided and is being done."""

    kind: Literal["begun"] = "begun"
    step: Step


class Arrived(Frozen):
    """The robot is where a move sent it."""

    kind: Literal["arrived"] = "arrived"
    at: SetKey
    orientation: int
    pose: SixNumbers


class Placed(Frozen):
    """The gauges stand around the ball."""

    kind: Literal["placed"] = "placed"
    at: SetKey


class Reading(Frozen):
    """A settled window of readings.

    ``gauges_mm`` and ``spread_mm`` are mean and range along base x, y, z; ``joints_mm`` the mean
    slider positions. ``answers`` and ``counts`` are the raw readings behind them, in the order taken.
    """

    gauges_mm: ThreeNumbers
    spread_mm: ThreeNumbers
    joints_mm: SixNumbers
    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]


class Sampled(Frozen):
    """A record was taken; ``deviation_mm`` is from the set's reference."""

    kind: Literal["sampled"] = "sampled"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reading: Reading
    deviation_mm: ThreeNumbers


class Refused(Frozen):
    """A record was not taken: the ball left the travel. The orientation is chosen anew."""

    kind: Literal["refused"] = "refused"
    at: SetKey
    orientation: int
    reason: str


class SetClosed(Frozen):
    """The reference was read again; ``drift_mm`` is the change since it was zeroed."""

    kind: Literal["closed"] = "closed"
    at: SetKey
    drift_mm: ThreeNumbers


class SetVoided(Frozen):
    """The set is no longer to be trusted and will be measured again; its records stay here."""

    kind: Literal["voided"] = "voided"
    at: SetKey
    reason: str


class Identified(Frozen):
    """The geometry was identified, and the poses that will judge it were chosen."""

    kind: Literal["identified"] = "identified"
    result: dict[str, Any]
    held_out: tuple[tuple[SixNumbers, ...], ...]


class Gate(Frozen):
    """One condition for writing back, and the sentence that says how it stands."""

    name: str
    passed: bool
    sentence: str
    needs_person: bool = False


class Proposed(Frozen):
    """The new geometry stands in the run folder, beside the conditions for writing it."""

    kind: Literal["proposed"] = "proposed"
    gates: tuple[Gate, ...]


class Committed(Frozen):
    """The controller's config holds the new geometry and the controller has read it."""

    kind: Literal["committed"] = "committed"
    approved_by: str


class Judged(Frozen):
    """The held-out points were compared."""

    kind: Literal["judged"] = "judged"
    verdict: Verdict
    line: str


class RolledBack(Frozen):
    """The controller's config is as it was before the run, bit for bit, and has been read."""

    kind: Literal["rolled back"] = "rolled back"


class Interrupted(Frozen):
    """The run stopped here: by a person, a fault, or because an answer is missing."""

    kind: Literal["interrupted"] = "interrupted"
    reason: str
    exit_code: int


class Ended(Frozen):
    """The run is over."""

    kind: Literal["ended"] = "ended"
    exit_code: int
    line: str


Event = Annotated[
    RunStarted
    | StepBegun
    | Arrived
    | Placed
    | Sampled
    | Refused
    | SetClosed
    | SetVoided
    | Identified
    | Proposed
    | Committed
    | Judged
    | RolledBack
    | Interrupted
    | Ended,
    Field(discriminator="kind"),
]
