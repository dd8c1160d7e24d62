"""Events of what the records gave: the identified geometry, changes of the config, and the verdict."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator

from hexacell.cell.fields import Frozen, GeometryDocument
from hexacell.checks.check_result import CheckResult
from hexacell.checks.quick_level import QuickAccuracy
from hexacell.results.result import ExpectedImprovement, IdentificationResult
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.verdict.acceptance_gates import AcceptanceGate
from hexacell.verdict.decision import Verdict
from hexacell.verdict.length_check import LengthStatement
from hexacell.verdict.verification import Verification
from procedures.run.steps import SixNumbers


class ProvisionalApplied(Frozen):
    """The controller commands with a provisional geometry while the points are measured.

    ``geometry`` is in the mechanism's frame convention. The earlier config is kept in ``folder``,
    a part of the run folder.
    """

    kind: Literal["lent"] = "lent"
    geometry: GeometryDocument
    folder: str


class ProvisionalReverted(Frozen):
    """The controller has read the config of before the provisional geometry."""

    kind: Literal["taken back"] = "taken back"


class Identified(Frozen):
    """The geometry was identified, and the held-out poses were chosen.

    ``held_out`` are measured at each point before and after, ``held_out_after`` only after: the robot
    cannot take them safely before it is calibrated. ``improvement`` is none where the robot can reach none
    of the task poses. ``quick`` is how well the quick level knows the robot; none in other runs.
    """

    kind: Literal["identified"] = "identified"
    result: IdentificationResult
    held_out: tuple[tuple[SixNumbers, ...], ...]
    held_out_after: tuple[tuple[SixNumbers, ...], ...] = ()
    improvement: ExpectedImprovement | None = None
    quick: QuickAccuracy | None = None


class Proposed(Frozen):
    """The new config was saved in the run folder, and the gates for writing it were evaluated.

    ``written`` is the geometry in it; ``displacement`` is how far that moves the task poses.
    """

    kind: Literal["proposed"] = "proposed"
    gates: tuple[AcceptanceGate, ...]
    written: GeometryDocument | None = None
    displacement: TaskDisplacement | None = None


class Committed(Frozen):
    """The controller has read a config with the new geometry."""

    kind: Literal["committed"] = "committed"
    approved_by: str


class ConfirmationPlanned(Frozen):
    """A test of the model failed, perhaps by chance: confirming held-out poses were chosen, which tell.

    ``poses`` are those at each held-out point, its reference first; none at a point that is left.
    """

    kind: Literal["confirmation planned"] = "confirmation planned"
    reason: str
    poses: tuple[tuple[SixNumbers, ...], ...]


def _present_name(verdict: object) -> object:
    """The verdict for a word of versions 1 and 2."""
    return Verdict.FAIL if verdict in {"out of limits", "worse than before"} else verdict


class ResultValidated(Frozen):
    """The verdict of the run.

    That of a calibration is by its ``verification``, of a check by its result ``check``, of a length check
    of its own by ``length``. Versions 1 and 2 have none of them, checks of version 3 have no ``check``.
    """

    kind: Literal["judged"] = "judged"
    verdict: Annotated[Verdict, BeforeValidator(_present_name)]
    line: str
    verification: Verification | None = None
    check: CheckResult | None = None
    length: LengthStatement | None = None


class ResultAccepted(Frozen):
    """A person decided on a result that did not pass; ``by`` is who keeps it, null if nobody does.

    ``asked`` is whether there was somebody to ask.
    """

    kind: Literal["accepted"] = "accepted"
    by: str | None
    asked: bool = True


class RolledBack(Frozen):
    """The controller has read the config of before the run, bit for bit."""

    kind: Literal["rolled back"] = "rolled back"
