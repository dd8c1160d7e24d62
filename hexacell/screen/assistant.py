"""Leads through the questions of a first cell file; nothing is written before the last is answered."""

from __future__ import annotations

from pathlib import Path

from hexacell.errors import HexacellError
from hexacell.services.devices.first_cell import CellDraft
from hexacell.text.screens.first_questions import first_question
from hexacell.text.screens.views import FirstQuestionView


class FirstCellAssistant:
    """Makes the cell file at a path, from a draft where something is known already.

    Attributes:
        is_done: whether the file is there.
    """

    def __init__(self, path: Path, draft: CellDraft | None = None) -> None:
        self.is_done = False
        self._draft = CellDraft(path) if draft is None else draft
        self._number = 0
        self._problem = ""

    def view(self) -> FirstQuestionView:
        """The question that is asked now."""
        return first_question(self._draft, self._number, self._problem)

    def answer(self, given: str) -> None:
        """Take an answer and go on to the next question; after the last one, write the file."""
        answers = self._draft.answers()
        name = answers[self._number].name
        self._problem = self._draft.problem(name, given)
        if self._problem:
            return
        self._draft.given[name] = given
        if self._number + 1 < len(answers):
            self._number += 1
        else:
            self._finish()

    def back(self) -> None:
        """Return to the question before."""
        self._number, self._problem = max(0, self._number - 1), ""

    def _finish(self) -> None:
        try:
            self._draft.write()
        except HexacellError as error:
            self._problem = str(error)
        else:
            self.is_done = True
