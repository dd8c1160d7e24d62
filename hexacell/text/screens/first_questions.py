"""The questions that lead to a first cell file; nothing is written before the last is answered."""

from pathlib import Path

from hexacell.errors import HexacellError
from hexacell.plugins import Group, names
from hexacell.services.devices.cell_answers import CellAnswer
from hexacell.services.devices.first_cell import CellDraft
from hexacell.storage.toml_document import is_secret

QUESTIONS = {
    "name": ("What is this cell called?", "A short name, as it is to stand on screens and in reports."),
    "config": (
        "In which file does the controller keep its geometry?",
        "Relative to the cell file. Its [geometry] has the drawing's numbers, and tells the mechanism.",
    ),
    "mechanism": ("Which mechanism is it?", "One of: {mechanisms}. The config tells it, as a rule."),
    "tolerance": (
        "How far may a joint or a leg's length be from the drawing, mm?",
        "What the builder promises, to either side. Better too much than too little; angles apart.",
    ),
    "controller": ("How is the controller spoken to?", "One of: {controllers}; see docs/drivers.md."),
    "host": ("What is the controller's network name or address?", "127.0.0.1 if it is this computer."),
    "port": ("On which TCP port does it listen?", "linuxcncrsh listens on 5007."),
    "joints": (
        "From where to where may the {joint}s go, {unit}?",
        "Two numbers: the smallest and the largest position of any {joint}.",
    ),
    "gauges.protocol": (
        "What does the {axis} gauge speak?",
        "sylvac, mux10 (Mitutoyo's multiplexer), cdi (CDI, Starrett), or one of docs/drivers.md.",
    ),
    "gauges.port": ("Where is the {axis} gauge connected?", "A device, such as /dev/ttyUSB0, or a URL."),
    "gauges.sign": (
        "Does the {axis} gauge show more when the ball moves along +{axis}?",
        "yes if it is on the +{axis} side of the ball and counts up when pushed in. A small move tries it.",
    ),
    "bus": (
        "Where is the CAN bus of the encoders?",
        "Interface, channel and bit/s, such as: socketcan can0 500000, or: slcan /dev/ttyACM0 500000.",
    ),
    "nodes": ("Which nodes are the encoders of the legs?", "A number a leg, in the order of the legs."),
    "plates": (
        "How far may the ball go from the middle of the gauges' plates, mm?",
        "Half of their width, less what the ball needs.",
    ),
    "points": (
        "Where is the middle of the workspace, and how far may the ball go from it, mm?",
        "Four numbers: x y z of the middle, and the distance. The points to measure follow from that.",
    ),
}


def question(draft: CellDraft, asked: CellAnswer) -> tuple[str, str]:
    """What is asked, and a hint."""
    if asked.meaning:
        need = "It may be empty." if asked.is_optional else "It is needed."
        text = f"Option {asked.path[-1]} of {draft.given['controller'].strip()}: {asked.meaning}."
        return text, f"{need} Text, or as in TOML: 5, [1, 2], {{ a = 1 }}."
    kind, _, of_gauge = asked.name.partition(".")
    axis, _, what = of_gauge.partition(".")
    text, hint = QUESTIONS[f"{kind}.{what}" if what else kind]
    words = draft.mechanism.words
    known = {"axis": axis, "joint": words.joint, "unit": words.joint_unit}
    known["mechanisms"] = ", ".join(names(Group.MECHANISMS))
    known["controllers"] = ", ".join(names(Group.CONTROLLERS))
    return text.format(**known), hint.format(**known)


class FirstCellAssistant:
    """Makes the cell file at a path, from a draft where something is known already.

    ``is_done`` is whether it is there, ``problem`` why the last answer could not be taken; empty if it
    could.
    """

    def __init__(self, path: Path, draft: CellDraft | None = None) -> None:
        self.is_done, self.problem = False, ""
        self._draft = CellDraft(path) if draft is None else draft
        self._number = 0

    @property
    def progress(self) -> str:
        """Which of how many questions is asked now, and about which machine."""
        of = f"{len(self._asked)}, {self._draft.mechanism.words.machine}"
        return f"Question {self._number + 1} of {of}"

    @property
    def _asked(self) -> list[CellAnswer]:
        return [one for one in self._draft.answers() if one.is_asked]

    @property
    def question(self) -> tuple[str, str]:
        """What is asked now, and a hint."""
        return question(self._draft, self._asked[self._number])

    @property
    def is_secret(self) -> bool:
        """Whether the answer is one that nobody but the person may read."""
        return is_secret(self._asked[self._number].path)

    @property
    def suggestion(self) -> str:
        """The previous answer to this question, or its default."""
        asked = self._asked[self._number]
        return self._draft.given.get(asked.name, asked.default)

    def answer(self, given: str) -> None:
        """Take an answer and go on to the next question; after the last one, write the file."""
        name = self._asked[self._number].name
        self.problem = self._draft.problem(name, given)
        if self.problem and not given.strip():
            self.problem = "Please type an answer."
        if self.problem:
            return
        self._draft.given[name] = given
        if self._number + 1 < len(self._asked):
            self._number += 1
            return
        try:
            self._draft.write()
        except HexacellError as error:
            self.problem = str(error)
        else:
            self.is_done = True

    def back(self) -> None:
        """Return to the question before."""
        self._number, self.problem = max(0, self._number - 1), ""
