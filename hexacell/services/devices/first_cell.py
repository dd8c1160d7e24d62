"""A cell file made from a few answers: each is checked by the rules of the whole file."""

from __future__ import annotations

import tomllib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomlkit

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell, validated
from hexacell.cell.model import cell_model
from hexacell.cell.robot import DEFAULT_MECHANISM
from hexacell.config.toml_format import NativeToml
from hexacell.errors import FileError, HexacellError, flatten_errors
from hexacell.kinematics.mechanism import Mechanism
from hexacell.plugins import Group, load
from hexacell.services.devices.first_answers import (
    GAUGE_AXES,
    CellAnswer,
    Document,
    gauge_answers,
    machine_answers,
    other_answers,
    putting,
)
from hexacell.services.records.offline import plan_of
from hexacell.services.records.stated_poses import require_stated_poses
from hexacell.storage.atomic_files import write_atomically
from hexacell.storage.toml_document import TomlDocument

HEADER = "# Made from a few answers. `hexacell cell show` prints it with every default.\n\n"
KEPT_SECTIONS = ("robot", "limits", "speed")
"""Of the simulated cell: where every answer has a place, and limits that are stated with care."""


@dataclass(frozen=True)
class FoundKeys:
    """Keys of a cell file whose values devices told."""

    gauges: tuple[Document, ...] = ()
    encoders: Document = field(default_factory=dict)


@dataclass
class CellDraft:
    """A cell file that is being made at ``path``; ``given`` are the answers so far, by name.

    ``found`` is what devices told that nobody is asked: keys of the gauges, in order, and of the encoders.
    """

    path: Path
    given: dict[str, str] = field(default_factory=dict)
    found: FoundKeys = field(default_factory=FoundKeys)

    def answers(self) -> tuple[CellAnswer, ...]:
        """All that is asked, in order."""
        config = CellAnswer("config", ("controller", "config"), self._put_config, self._likely_config())
        return (
            CellAnswer("name", ("name",), putting(("name",)), self.path.stem[:40]),
            config,
            *machine_answers(),
            *(answer for number in range(len(GAUGE_AXES)) for answer in gauge_answers(number)),
            *other_answers(),
        )

    def problem(self, name: str, given: str) -> str:
        """Why an answer cannot be taken; empty if it can."""
        if not given.isprintable():
            return "it has characters that cannot be shown; type it again"
        [answer] = [one for one in self.answers() if one.name == name]
        try:
            document = TomlDocument.parse(self._text({**self.given, name: given}), self.path)
        except ValueError as error:
            return str(error)
        try:
            validated(document, cell_model(DEFAULT_MECHANISM), self.path)
        except HexacellError as error:
            lines = {document.line_of(answer.path), document.line_of(answer.path[:-1])}
            return _about(error, lines)
        return ""

    def write(self) -> None:
        """Write the file.

        Raises:
            FileError: it is there, cannot be written, or a pose is out of reach; then there is no new file.
            SeveralErrors: more than one is.
        """
        if self.path.exists():
            raise FileError("is there by now", subject=self.path, action="Remove it, or name another")
        write_atomically(self.path, self._text(self.given).encode())
        try:
            cell = load_cell(self.path)
            require_stated_poses(cell, plan_of(cell))
        except HexacellError:
            self.path.unlink()
            raise

    def _text(self, given: dict[str, str]) -> str:
        """The file; raises ``ValueError`` where an answer cannot be read."""
        document = _beginning()
        for gauge, keys in zip(document["gauges"], self.found.gauges, strict=False):
            gauge.update(keys)
        document["encoders"] |= self.found.encoders
        for answer in self.answers():
            if answer.name in given:
                answer.put(document, given[answer.name])
            else:
                with suppress(ValueError):  # it is asked later
                    answer.put(document, answer.default)
        return HEADER + tomlkit.dumps(document)

    def _put_config(self, document: Document, given: str) -> None:
        """Before it is calibrated, a controller has the geometry of the drawing."""
        document["controller"]["config"] = given.strip()
        try:
            read = _config_format().read(self.path.parent / given.strip())
        except HexacellError as error:
            raise ValueError(str(error)) from error
        document["robot"]["nominal"] = read.geometry.document()

    def _likely_config(self) -> str:
        """The only file beside it that is a controller's config, or a usual name."""
        found = [path.name for path in sorted(self.path.parent.glob("*.toml")) if _is_config(path)]
        return found[0] if len(found) == 1 else "robot.toml"


def _beginning() -> Document:
    """What every first cell has."""
    bundled: dict[str, Any] = tomllib.loads(bundled_config("simulated-hexaglide").read_text())
    kept = {name: bundled[name] for name in KEPT_SECTIONS}
    return {
        "version": 1,
        "name": "",
        "controller": {"config": "robot.toml"},
        "gauges": [{"name": axis, "axis": axis, "protocol": "sylvac"} for axis in GAUGE_AXES],
        "encoders": {"protocol": "cia406"},
        "tolerances": {},
        "identification": {"points": []},
        "verification": {"points": []},
        **kept,
    }


def _config_format() -> NativeToml:
    mechanism: Mechanism = load(Group.MECHANISMS, DEFAULT_MECHANISM)()
    return NativeToml(mechanism.parameters)


def _is_config(path: Path) -> bool:
    try:
        _config_format().read(path)
    except HexacellError:
        return False
    return True


def _about(error: HexacellError, lines: set[int | None]) -> str:
    """What an error says of an answer, or of its section, by their lines; nothing of others."""
    for one in flatten_errors(error):
        if isinstance(one, FileError) and one.line in lines:
            return one.problem if one.action is None else f"{one.problem}. {one.action}"
    return ""
