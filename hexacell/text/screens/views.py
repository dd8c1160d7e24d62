"""What the screens show, as data: banner, cards, tables, pictures with axes, questions, faults, checklists.

Only the standard library is imported, so that the first screen is drawn before anything is computed.
Urgency and markers are words and signs as well as colours, so that any terminal shows them.
"""

from dataclasses import dataclass
from enum import StrEnum


class Urgency(StrEnum):
    """How much attention something needs; good is what was wanted."""

    CALM = "calm"
    GOOD = "good"
    ATTENTION = "attention"
    ALARM = "alarm"


Line = tuple[str, Urgency]
"""A line of text, and how much attention it needs."""


@dataclass(frozen=True, slots=True)
class Banner:
    """What is so in a word, and the one thing to do; on every screen.

    Attributes:
        word: the state, in capitals.
        action: what a person does now, with its key, or what goes on while there is nothing to do.
        following: what comes next; empty if nothing is known.
        rest: the time that is left, and how to stop.
    """

    word: str
    action: str
    following: str = ""
    rest: str = ""
    urgency: Urgency = Urgency.CALM


@dataclass(frozen=True, slots=True)
class Card:
    """One device: its name, how it stands in a word, a large figure, and lines below it."""

    title: str
    state: str
    urgency: Urgency
    figure: str = ""
    lines: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table: its head, its width, and whether its cells stand right, as figures do."""

    name: str
    width: int
    is_figure: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table: a name of its own, its cells, and how much attention it needs."""

    name: str
    cells: tuple[str, ...]
    urgency: Urgency = Urgency.CALM


@dataclass(frozen=True, slots=True)
class Series:
    """Points of a picture under one name and one marker."""

    name: str
    marker: str
    points: tuple[tuple[float, float], ...]


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
    series: tuple[Series, ...] = ()
    level: float | None = None
    level_name: str = ""
    is_logarithmic: bool = False
    note: str = ""

    @property
    def legend(self) -> str:
        """What each marker is."""
        named = [f"{one.marker} {one.name}" for one in self.series if one.points]
        line = [f"┄ {self.level_name}"] if self.level is not None and self.level_name else []
        return "   ".join([*named, *line])

    @property
    def is_empty(self) -> bool:
        """Whether there is no point to draw."""
        return not any(one.points for one in self.series)


@dataclass(frozen=True, slots=True)
class Choice:
    """One answer to a question: its key, its words, and the value that answers.

    ``is_consent`` is whether it begins motion or a change that may be refused. ``typed`` is what is typed
    for it at a plain terminal; empty for the first word of the label.
    """

    key: str
    label: str
    value: str | None
    is_consent: bool = False
    typed: str = ""

    @property
    def word(self) -> str:
        """What is typed for it at a plain terminal, beside its key."""
        return self.typed or self.label.partition(":")[0].partition(",")[0]

    def is_meant(self, typed: str) -> bool:
        """Whether a typed word means it; consent is typed in full, others may be shortened."""
        is_begun = bool(typed) and self.word.startswith(typed) and not self.is_consent
        return (typed or "enter") in {self.key, self.word} or is_begun


class Beside(StrEnum):
    """What is shown beside a question, as it is now."""

    NOTHING = "nothing"
    GAUGES = "gauges"
    PLACING = "placing"


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
        beside: what is shown beside it.
    """

    title: str
    paragraphs: tuple[str, ...]
    instruction: str
    choices: tuple[Choice, ...]
    change: str = ""
    typed: str = ""
    consent: str | None = None
    refusal: str = ""
    beside: Beside = Beside.NOTHING
    urgency: Urgency = Urgency.ATTENTION

    def typed_choice(self, line: str) -> Choice | None:
        """The choice that a line typed at a plain terminal means, None if it means none."""
        typed = line.strip().lower()
        if self.typed and typed == self.typed.lower():
            return Choice("", self.typed, self.consent, is_consent=True)
        meant = [one for one in self.choices if one.is_meant(typed.replace(" ", "-"))]
        return meant[0] if len(meant) == 1 else None

    @property
    def request(self) -> str:
        """What to type at a plain terminal."""
        words = [one.word for one in self.choices]
        if self.typed:
            return f"Type the cell's name, {self.typed}, to take the responsibility, or no: "
        if self.choices[0].key == "enter":
            return "Press Enter when they are in place, or type a to abort: "
        several = f"one of {', '.join(words)}"
        return f"Type {' or '.join(words) if len(words) == 2 else several}: "


@dataclass(frozen=True, slots=True)
class FaultView:
    """Something went wrong: what, why, and what to do next."""

    title: str
    cause: str
    action: str


class Mark(StrEnum):
    """How one item of a list stands, by a sign that needs no colour."""

    DONE = "✓"
    FAILED = "✗"
    BUSY = "…"
    OPEN = "·"


@dataclass(frozen=True, slots=True)
class ChecklistItem:
    """One thing that must hold before motion.

    Attributes:
        mark: how it stands.
        finding: what was found; empty for nothing.
        action: what to do where it does not hold.
        details: what is shown below it only where somebody asks for all.
    """

    mark: Mark
    name: str
    finding: str = ""
    action: str = ""
    details: tuple[str, ...] = ()

    def lines(self, *, is_unfolded: bool) -> list[Line]:
        """How it stands, and below it what to do, and all details where they are asked for."""
        failed = self.mark is Mark.FAILED
        line = f"{self.mark} {self.name}{f': {self.finding}' if self.finding else ''}"
        lines = [(line, Urgency.ALARM if failed else Urgency.CALM)]
        if self.action and failed:
            lines.append((f"  → {self.action}", Urgency.ATTENTION))
        return [*lines, *((f"    {one}", Urgency.CALM) for one in self.details if is_unfolded)]
