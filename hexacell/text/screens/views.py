"""The views of the screens: text and numbers, ready to be drawn.

Only the standard library is imported, so that the first screen is drawn before anything is computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Mark(StrEnum):
    """How one item of a list stands, in two letters that need no colour."""

    DONE = "ok"
    FAILED = "NO"
    BUSY = ".."
    OPEN = "--"


class Urgency(StrEnum):
    """How much attention a text needs."""

    CALM = "calm"
    ATTENTION = "attention"
    ALARM = "alarm"


@dataclass(frozen=True, slots=True)
class HeaderView:
    """The first line: which cell, what is done there, its state, and who is in control."""

    cell: str
    activity: str = ""
    status: str = ""
    control: str = ""
    urgency: Urgency = Urgency.CALM


@dataclass(frozen=True, slots=True)
class Guidance:
    """What happens now, what is next, how long it takes, and how to stop."""

    now: str
    following: str
    remaining: str
    stopping: str


@dataclass(frozen=True, slots=True)
class GaugeReadout:
    """One gauge as it shows now.

    Attributes:
        reading: as its display has it, with ``unit``.
        deviation: along its base axis from the zero of the set; empty without one.
        bar: the plunger's place in its travel as a picture, and ``place`` in numbers.
        advice: what to do with it, or why nothing is to be done.
        problem: why it does not answer; empty if it does.
    """

    name: str
    axis: str
    reading: str
    unit: str
    deviation: str
    age: str
    noise: str
    bar: str
    place: str
    advice: str
    problem: str = ""

    @property
    def urgency(self) -> Urgency:
        """Alarm where the gauge does not answer."""
        return Urgency.ALARM if self.problem else Urgency.CALM


@dataclass(frozen=True, slots=True)
class DeviceLine:
    """One device in a line of text."""

    name: str
    text: str
    urgency: Urgency = Urgency.CALM


@dataclass(frozen=True, slots=True)
class LiveView:
    """All devices as they show now; ``note`` says so where nothing is known."""

    gauges: tuple[GaugeReadout, ...] = ()
    devices: tuple[DeviceLine, ...] = ()
    note: str = ""


@dataclass(frozen=True, slots=True)
class Series:
    """Points of a picture under one name and one marker."""

    name: str
    marker: str
    xs: tuple[float, ...]
    ys: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class PlotView:
    """A picture with axes.

    Attributes:
        level: the value of a horizontal line, and ``level_name`` what it is; None without a line.
        is_logarithmic: whether its vertical axis is; then all its values are above zero.
        note: what is said instead while there is nothing to draw.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...] = ()
    level: float | None = None
    level_name: str = ""
    is_logarithmic: bool = False
    note: str = ""

    @property
    def legend(self) -> str:
        """What each marker is."""
        named = [f"{one.marker} {one.name}" for one in self.series if one.xs]
        line = [f"- {self.level_name}"] if self.level is not None and self.level_name else []
        return "   ".join([*named, *line])

    @property
    def is_empty(self) -> bool:
        """Whether there is no point to draw."""
        return not any(one.xs for one in self.series)


@dataclass(frozen=True, slots=True)
class MeasureView:
    """The screen of a run that is being measured; ``records`` has a line each, the latest last."""

    guidance: Guidance
    live: LiveView
    records_title: str
    records_header: str
    records: tuple[str, ...]
    accuracy: PlotView


@dataclass(frozen=True, slots=True)
class Choice:
    """One answer to a question: its key, its words, and the value that answers.

    ``is_consent`` is whether it begins motion or a change that may be refused.
    """

    key: str
    label: str
    value: str | None
    is_consent: bool = False


@dataclass(frozen=True, slots=True)
class QuestionView:
    """A question of a run.

    Attributes:
        paragraphs: what is asked, and what there is to know for it.
        instruction: what to do to answer.
        choices: answers of one key each.
        typed: the text that must be typed to consent; empty if one key is enough.
        consent: the value that answers then.
        refusal: why the answer of consent cannot be given; empty if it can.
        shows_gauges: whether the gauges are shown with it.
    """

    title: str
    paragraphs: tuple[str, ...]
    instruction: str
    choices: tuple[Choice, ...]
    typed: str = ""
    consent: str | None = None
    refusal: str = ""
    shows_gauges: bool = False
    urgency: Urgency = Urgency.ATTENTION


@dataclass(frozen=True, slots=True)
class FaultView:
    """Something went wrong: what, why, and what to do next."""

    title: str
    cause: str
    action: str


@dataclass(frozen=True, slots=True)
class CellView:
    """The cell: its devices live, and what its file says with the origin of each value."""

    title: str
    live: LiveView
    settings: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ChecklistItem:
    """One thing that must hold before motion: how it stands, what was found, and what to do."""

    mark: Mark
    name: str
    finding: str = ""
    action: str = ""


@dataclass(frozen=True, slots=True)
class ChecklistView:
    """Everything that must hold before motion, and what the plan is expected to give.

    ``refusal`` is why no run can be started now; empty if one can.
    """

    items: tuple[ChecklistItem, ...]
    plan: tuple[str, ...]
    instruction: str
    refusal: str = ""


@dataclass(frozen=True, slots=True)
class PlanView:
    """Exclusions and the poses of a plan; ``note`` says where they come from, or why there are none.

    Each row is the name of a point, a pose or an exclusion, and a line of text.
    """

    note: str
    rows: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class ReviewView:
    """A result: the verdict first, with its scope, and everything behind it.

    Attributes:
        scope: what the verdict holds for, and what was not checked.
        approval: what is to be decided, or why it cannot be yet.
        comparison: before and after at the held-out points.
    """

    verdict: str
    scope: tuple[str, ...]
    approval: str
    parameters_header: str = ""
    parameters: tuple[str, ...] = ()
    comparison: tuple[str, ...] = ()
    plots: tuple[PlotView, ...] = ()
    change: tuple[str, ...] = ()
    urgency: Urgency = Urgency.CALM


@dataclass(frozen=True, slots=True)
class FirstQuestionView:
    """One question of the first-time assistant.

    Attributes:
        progress: which of how many it is.
        answer: what is in the field at first.
        problem: why the last answer could not be taken; empty if it could.
    """

    progress: str
    text: str
    hint: str
    answer: str
    problem: str = ""


@dataclass(frozen=True, slots=True)
class HistoryEntry:
    """One run of the cell: the name of its folder, and a line of text.

    ``has_proposal`` is whether it proposed a change that can still be written.
    """

    name: str
    line: str
    has_proposal: bool = False


@dataclass(frozen=True, slots=True)
class HistoryView:
    """The runs of a cell, the latest first; ``note`` says so where there are none.

    ``comparison`` is what was asked about one of them.
    """

    header: str
    entries: tuple[HistoryEntry, ...]
    comparison: tuple[str, ...] = ()
    note: str = ""
