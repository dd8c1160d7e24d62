"""What the files of a config hold, and what names that: one fingerprint of all."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from hexacell.storage import atomic_files

Contents = tuple[bytes, ...]
"""Of each file, in the order in which the cell file names them."""


def read_contents(paths: Iterable[Path]) -> Contents:
    """What the files hold now; raises ``FileError``."""
    return tuple(atomic_files.read_bytes(path) for path in paths)


def read_contents_if_present(paths: Iterable[Path]) -> Contents | None:
    """The same; none if one of the files is not there."""
    found = [atomic_files.read_if_present(path) for path in paths]
    there = tuple(data for data in found if data is not None)
    return there if len(there) == len(found) else None


def fingerprint_of(contents: Contents) -> str:
    """The SHA-256 of a single file; of several that of their SHA-256s, in order, a line each."""
    each = [atomic_files.sha256(data) for data in contents]
    if len(each) == 1:
        return each[0]
    return atomic_files.sha256("".join(f"{one}\n" for one in each).encode())


def fingerprint(*paths: Path) -> str:
    """That of a config, for the start of a run; raises ``FileError``."""
    return fingerprint_of(read_contents(paths))


def names_of(paths: Sequence[Path]) -> tuple[str, ...]:
    """What the files are called in text: their names, or more of their paths where these are the same."""
    names = tuple(path.name for path in paths)
    if len({*names}) == len(names):
        return names
    absolute = [path.absolute() for path in paths]
    common = os.path.commonpath([path.parent for path in absolute])
    return tuple(os.path.relpath(path, common) for path in absolute)


def are_same_files(some: Sequence[Path], others: Sequence[Path]) -> bool:
    """Whether two configs are the same files in the same order, links resolved."""
    return [os.path.realpath(path) for path in some] == [os.path.realpath(path) for path in others]
