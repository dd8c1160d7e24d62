"""How much room is left where a run is kept."""

from __future__ import annotations

import shutil
from pathlib import Path

from hexacell import files


def free_bytes(folder: Path) -> int:
    """Free bytes on the file system of a folder that may not exist yet.

    Raises:
        FileError: nobody can tell.
    """
    there = next((path for path in (folder, *folder.parents) if path.exists()), folder)
    try:
        return shutil.disk_usage(there).free
    except OSError as error:
        raise files.plain_error("its free space cannot be told", there, error) from error
