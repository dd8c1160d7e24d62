"""The answers to the questions for a first cell file in a file of their own, where there is no terminal."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import tomlkit

from hexacell.errors import HexacellError, did_you_mean, joined
from hexacell.plugins import Group, names
from hexacell.services.devices.cell_answers import OPTIONS, CellAnswer
from hexacell.services.devices.first_cell import CellDraft
from hexacell.storage.toml_document import KeyPath, TomlDocument
from hexacell.text.layout import wrapped
from hexacell.text.screens.first_questions import question

HEADER = "Answers for `hexacell devices --write CELL --answers FILE`. Correct them; all are needed."


def template(draft: CellDraft) -> str:
    """A file with every question, and what is known or proposed as its answer."""
    lines = [_comment(HEADER)]
    for asked in (one for one in draft.answers() if one.is_asked):
        answer = tomlkit.item(draft.given.get(asked.name, asked.default)).as_string()
        lines += ["", _comment(" ".join(question(draft, asked))), f"{asked.name} = {answer}"]
    for protocol in names(Group.CONTROLLERS):
        with suppress(HexacellError):  # a broken plug-in is told once it is chosen
            of_it = replace(draft, given={**draft.given, "controller": protocol})
            for one in (one for one in of_it.answers() if one.meaning):
                lines += ["", _comment(" ".join(question(of_it, one))), f'# {one.name} = ""']
    return "\n".join(lines) + "\n"


def take(draft: CellDraft, document: TomlDocument) -> None:
    """Answer the questions of a draft, in their order, each as if it were typed.

    Raises:
        FileError: an answer cannot be taken or is missing, or there is no such question.
        SeveralErrors: more than one.
    """
    given = {".".join(map(str, path)): (path, value) for path, value in _leaves(document.data)}
    errors: list[HexacellError] = []
    seen = set[str]()
    while (asked := next((one for one in draft.answers() if one.name not in seen), None)) is not None:
        seen.add(asked.name)
        path, value = given.pop(asked.name, ((), None))
        text, hint = question(draft, asked)
        action = hint if asked.default in hint else f"{hint} Such as: {asked.default}"
        if value is not None:
            typed = _as_typed(asked, value)
            if problem := draft.problem(asked.name, typed):
                errors.append(document.error(path, f"{asked.name}: {problem}", action))
            else:
                draft.given[asked.name] = typed
        elif not asked.is_optional and asked.name not in draft.given:
            errors.append(document.error((), f"{asked.name} is missing", f"{text} {action}"))
    for name, (path, _) in given.items():
        if path[0] == OPTIONS and "controller" not in draft.given:
            continue  # of which controller is told already
        action = did_you_mean(name, seen) or f"There are: {', '.join(sorted(seen))}"
        errors.append(document.error(path, f"there is no question {name}", action))
    if errors:
        raise joined(f"{document.source} has {len(errors)} mistakes", errors)


def _leaves(table: Mapping[str, Any], path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    for key, value in table.items():
        if isinstance(value, dict) and path != (OPTIONS,):
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key), value


def _as_typed(asked: CellAnswer, value: object) -> str:
    """An answer as it would be typed; of an option as TOML has it."""
    if asked.meaning:
        in_a_line = tomlkit.inline_table().append("x", value)
        return in_a_line.as_string().removeprefix("{x = ").removesuffix("}")
    if isinstance(value, bool):
        return "yes" if value else "no"
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _comment(text: str) -> str:
    return "\n".join(f"# {line}" for line in wrapped(text).splitlines())
