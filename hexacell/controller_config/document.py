"""Records that have a JSON file of their own in the run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from hexacell import files
from hexacell.errors import FileError


class Document(BaseModel):
    """A frozen record; written atomically, checked when read."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1] = 1

    def to_json(self) -> bytes:
        """The record as a JSON file's content."""
        return self.model_dump_json(indent=2).encode() + b"\n"

    def save(self, path: Path) -> None:
        """Write the record atomically; raises ``FileError``."""
        files.write_atomically(path, self.to_json())

    @classmethod
    def load(cls, path: Path) -> Self:
        """The record in a JSON file; raises ``FileError`` if there is none or it is damaged."""
        try:
            return cls.model_validate_json(files.read_bytes(path))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(str(key) for key in first["loc"]) or "the whole"
            problem = f"this is no {cls.__name__.lower()}: {where}: {first['msg']}"
            raise FileError(problem, subject=path, action="Restore the file") from error
