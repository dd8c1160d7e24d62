"""The questions that lead to a first cell file; nothing is written before the last is answered."""

from pathlib import Path

from hexacell.errors import HexacellError
from hexacell.services.devices.first_cell import CellDraft

QUESTIONS = {
    "name": ("What is this cell called?", "A short name, as it is to stand on screens and in reports."),
    "config": (
        "In which file does the controller keep its geometry?",
        "Relative to the cell file. Its [geometry] has the drawing's numbers, and tells the mechanism.",
    ),
    "tolerance": (
        "How far may a joint or a leg's length be from the drawing, mm?",
        "What the builder promises, to either side. Better too much than too little; angles apart.",
    ),
    "host": ("What is the controller's network name or address?", "127.0.0.1 if it is this computer."),
    "port": ("On which TCP port does it listen?", "linuxcncrsh listens on 5007."),
    "joints": (
        "From where to where may the {joint}s go, {unit}?",
        "Two numbers: the smallest and the largest position of any {joint}.",
    ),
    "protocol": (
        "What does the {axis} gauge speak?",
        "sylvac, mux10 (Mitutoyo's multiplexer), cdi (CDI, Starrett), or one of docs/drivers.md.",
    ),
    "port of gauge": ("Where is the {axis} gauge connected?", "A device, such as /dev/ttyUSB0, or a URL."),
    "sign": (
        "Does the {axis} gauge show more when the ball moves along +{axis}?",
        "yes if it is on the +{axis} side of the ball and counts up when pushed in. A small move tries it.",
    ),
    "bus": (
        "Where is the CAN bus of the encoders?",
        "Interface, channel and bit/s, such as: socketcan can0 500000, or: slcan /dev/ttyACM0 500000.",
    ),
    "nodes": ("Which nodes are the encoders of legs 1 to 6?", "Six numbers, in the order of the legs."),
    "plates": (
        "How far may the ball go from the middle of the gauges' plates, mm?",
        "Half of their width, less what the ball needs.",
    ),
    "points": (
        "Where is the middle of the workspace, and how far may the ball go from it, mm?",
        "Four numbers: x y z of the middle, and the distance. The points to measure follow from that.",
    ),
}


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
        of = f"{len(self._draft.answers())}, {self._draft.mechanism.words.machine}"
        return f"Question {self._number + 1} of {of}"

    @property
    def question(self) -> tuple[str, str]:
        """What is asked now, and a hint."""
        kind, _, axis = self._draft.answers()[self._number].name.partition(" ")
        text, hint = QUESTIONS["port of gauge" if kind == "port" and axis else kind]
        words = self._draft.mechanism.words
        known = {"axis": axis, "joint": words.joint, "unit": words.joint_unit}
        return text.format(**known), hint.format(**known)

    @property
    def suggestion(self) -> str:
        """The previous answer to this question, or its default."""
        asked = self._draft.answers()[self._number]
        return self._draft.given.get(asked.name, asked.default)

    def answer(self, given: str) -> None:
        """Take an answer and go on to the next question; after the last one, write the file."""
        answers = self._draft.answers()
        name = answers[self._number].name
        self.problem = self._draft.problem(name, given)
        if self.problem and not given.strip():
            self.problem = "Please type an answer."
        if self.problem:
            return
        self._draft.given[name] = given
        if self._number + 1 < len(answers):
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
