"""What the screens draw: questions, faults, checklists, pictures with axes in characters, and help.

Only the standard library is imported, so that the first screen is drawn before anything is computed.
Pictures have markers instead of colours, so that any terminal shows them.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import ceil, floor, isfinite, log10


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
        line = [f"- {self.level_name}"] if self.level is not None and self.level_name else []
        return "   ".join([*named, *line])

    @property
    def is_empty(self) -> bool:
        """Whether there is no point to draw."""
        return not any(one.points for one in self.series)


@dataclass(frozen=True, slots=True)
class Choice:
    """One answer to a question: its key, its words, and the value that answers.

    ``is_consent`` is whether it begins motion or a change that may be refused.
    """

    key: str
    label: str
    value: str | None
    is_consent: bool = False

    @property
    def word(self) -> str:
        """What is typed for it at a plain terminal, beside its key."""
        return self.label.partition(":")[0].partition(",")[0]

    def is_meant(self, typed: str) -> bool:
        """Whether a typed word means it; consent is typed in full, others may be shortened."""
        is_begun = bool(typed) and self.word.startswith(typed) and not self.is_consent
        return (typed or "enter") in {self.key, self.word} or is_begun


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


LABEL_COLUMNS = 6
"""Left of the vertical axis."""
FEWEST_COLUMNS, FEWEST_ROWS = 16, 5
"""In less room a picture says nothing."""


@dataclass(frozen=True, slots=True)
class _Scale:
    """Values from ``low`` to ``high`` on a number of cells; logarithms if ``is_logarithmic``."""

    low: float
    high: float
    cells: int
    is_logarithmic: bool = False

    def cell(self, value: float) -> int:
        """The cell of a value, from 0."""
        low, high, at = (log10(one) if self.is_logarithmic else one for one in (self.low, self.high, value))
        share = (at - low) / (high - low)
        return round(min(max(share, 0.0), 1.0) * (self.cells - 1))


def plot_lines(view: PlotView, columns: int, rows: int) -> list[str]:
    """A picture of ``rows`` lines and ``columns`` columns; empty where there is no room or no point."""
    if view.is_empty or columns < FEWEST_COLUMNS or rows < FEWEST_ROWS:
        return []
    xs = [x for series in view.series for x, _ in series.points]
    across = _Scale(min(xs), max(xs) if max(xs) > min(xs) else min(xs) + 1.0, columns - LABEL_COLUMNS - 1)
    down = _down(view, rows - 2)
    cells = [[" "] * across.cells for _ in range(down.cells)]
    if view.level is not None:
        cells[down.cell(view.level)] = ["-"] * across.cells
    for series in view.series:
        for x, y in series.points:
            cells[down.cell(y)][across.cell(x)] = series.marker
    labels = _labels(down)
    drawn = [f"{labels.get(row, ''):>{LABEL_COLUMNS}}|{''.join(cells[row])}" for row in range(down.cells)]
    drawn.reverse()
    first, last = f"{across.low:g}", f"{across.high:g}"
    middle = view.x_label.center(max(0, across.cells - len(first) - len(last)))
    below = f"{'':{LABEL_COLUMNS + 1}}{first}{middle}{last}"[: LABEL_COLUMNS + 1 + across.cells]
    return [*drawn, f"{'':{LABEL_COLUMNS}}+{'-' * across.cells}", below]


def _down(view: PlotView, cells: int) -> _Scale:
    """From one round number to another, so that both ends have a label."""
    ys = [y for series in view.series for _, y in series.points if isfinite(y)]
    ys += [] if view.level is None else [view.level]
    low, high = min(ys), max(ys)
    if view.is_logarithmic:
        power = 10.0 ** floor(log10(low))
        first = max(part * power for part in (1.0, 2.0, 5.0) if part * power <= low * (1.0 + 1e-9))
        last = _round_above(high)
        return _Scale(first, last if last > first else 10.0 * first, cells, is_logarithmic=True)
    step = _step(high - low, cells)
    first, last = step * floor(low / step), step * ceil(high / step)
    return _Scale(first, last if last > first else first + step, cells)


def _round_above(value: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below a value."""
    power = 10.0 ** floor(log10(value))
    return min(part * power for part in (1.0, 2.0, 5.0, 10.0) if part * power >= value * (1.0 - 1e-9))


def _step(span: float, cells: int) -> float:
    """Between labels; at most one for every two cells."""
    return _round_above(max(span, 1e-6) / max(1, cells // 3))


def _labels(scale: _Scale) -> dict[int, str]:
    if not scale.is_logarithmic:
        step = _step(scale.high - scale.low, scale.cells)
        count = round((scale.high - scale.low) / step)
        return {scale.cell(scale.low + n * step): f"{scale.low + n * step:g}" for n in range(count + 1)}
    powers = range(floor(log10(scale.low)), ceil(log10(scale.high)) + 1)
    few = len(powers) * 3 <= scale.cells
    values = [part * 10.0**power for power in powers for part in ((1.0, 2.0, 5.0) if few else (1.0,))]
    ends = (scale.low, scale.high)
    inside = [value for value in values if scale.low <= value <= scale.high]
    return {scale.cell(value): f"{value:.3g}" for value in (*inside, *ends)}


SCREEN_HELP = {
    "cell": """\
What is attached shows here as it is now: each gauge with its reading, unit, age and noise, the six \
encoders, and the controller. Below is what the cell file says; behind each value is its line in the \
file, or "default" where the file does not state it.

A device that does not answer says why. Mend that before you go to 2 Preflight.""",
    "preflight": """\
Everything that must hold before the robot moves, one line each:
  ok  it holds      NO  it does not, with what to do
  ..  being looked at      --  not looked at yet
Enter looks at all of it; nothing moves. v tries the plan on simulated robots and says how many records \
and minutes it takes and how accurate the robot will be. x shows its poses: x there excludes, in the \
cell file, what the robot must not be sent to. s starts a calibration, k a check that changes nothing, K \
the quick level, which corrects with fewer records what has drifted since the last result, r goes on \
with the latest run that was interrupted. In a cell with a fixture of known length, l checks the length \
scale, and L calibrates and checks it before the verdict. Everything is looked at again before the first \
move.""",
    "measure": """\
What happens now, what is next, how long it takes, and how to stop. Each gauge shows its reading, the \
deviation d from the zero of the set, the age of the reading, its noise, and where its plunger stands in \
its travel. A record lands with its residual: what was measured less what was predicted, the largest of \
x, y and z, and how many sigma that is. More than 4 sigma deserves a look.

The picture is the predicted error at the worst task pose; it falls record by record to the target.""",
    "review": """\
The verdict first, with what it holds for and what was not checked. Then each parameter: old, new, \
change, its standard deviation sigma, and what that means. Before and after are compared at poses that \
took no part in the identification. Last is the exact change of the controller's config.

Press w to approve or decline. Approving is refused, with the reason, until the gates pass. Where the \
change is beyond the drawing's tolerance, the cell's name must be typed.""",
    "history": """\
All runs of this cell, the latest first. The arrows choose one.
  Enter  open it: 3 Measure and 4 Review show it as it was, with a cursor in time
  v      compare it with the one before it
  o      the drift of each parameter over all runs, with its sigma
  b      go back to the config that it wrote, or undo it if the controller has it
  w      write the proposal of a run that nobody has approved yet

Going back and writing ask first. They are refused where somebody has edited the file since; then all \
three versions are shown. A proposal is written under the gates of its run.""",
}

REPLAY_HELP = """\
A recorded run: space plays or halts it, right and left step by one event, page down and page up by a \
hundred, home and end go to its ends, + and - change the speed. Nothing moves."""

KEYS_TITLE = "Keys, the same on every screen"

KEYS_NOTE = "Choose others in {path}, below [keys]. Everything is in the palette as well (ctrl+p)."
