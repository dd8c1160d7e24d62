"""Who owns the files of these tests, and what is in a folder."""

from pathlib import Path

NOBODY = 65534


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
