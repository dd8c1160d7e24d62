"""Records that have a JSON file of their own."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from hexacell.errors import FileError
from hexacell.storage import atomic_files


class JsonRecord(BaseModel):
    """A frozen record: written atomically, validated when read."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    noun: ClassVar[str]
    """What error messages call it."""

    version: Literal[1] = 1

    def to_json(self) -> bytes:
        """The record as a JSON file's content."""
        return self.model_dump_json(indent=2).encode() + b"\n"

    def save(self, path: Path) -> None:
        """Write the record atomically; raises ``FileError``."""
        atomic_files.write_atomically(path, self.to_json())

    @classmethod
    def load(cls, path: Path) -> Self:
        """The record in a JSON file; raises ``FileError`` if there is none or it is damaged."""
        try:
            return cls.model_validate_json(atomic_files.read_bytes(path))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(str(key) for key in first["loc"]) or "the file"
            problem = f"this is not a {cls.noun}: {where}: {first['msg']}"
            raise FileError(problem, subject=path, action="Restore the file") from error
