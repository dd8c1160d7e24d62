"""What the screens draw: questions, faults, checklists, pictures, and large figures.

Only the standard library is imported, so that the first screen is drawn before anything is computed.
"""

from dataclasses import dataclass
from enum import StrEnum


class Urgency(StrEnum):
    """How much attention a text needs."""

    CALM = "calm"
    ATTENTION = "attention"
    ALARM = "alarm"


Line = tuple[str, Urgency]
"""A line of text, and how much attention it needs."""


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
        change: the change of a config that it is about, as a diff with a heading; empty without.
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
    change: str = ""
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


class Mark(StrEnum):
    """How one item of a list stands, in two letters that need no colour."""

    DONE = "ok"
    FAILED = "NO"
    BUSY = ".."
    OPEN = "--"


@dataclass(frozen=True, slots=True)
class ChecklistItem:
    """One thing that must hold before motion: how it stands, what was found, and what to do."""

    mark: Mark
    name: str
    finding: str = ""
    action: str = ""

    @property
    def lines(self) -> list[str]:
        """How it stands, and below it what to do."""
        lines = [f"{self.mark}  {self.name}{f': {self.finding}' if self.finding else ''}"]
        return [*lines, f"    -> {self.action}"] if self.action and self.mark is Mark.FAILED else lines
