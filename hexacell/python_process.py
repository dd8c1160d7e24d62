"""Processes of this program's own, which import nothing that lies in the folder they are started in.

That is a cell's folder as a rule, and files in it may come from anybody.
"""

import os
import sys


def python_command(module: str, *arguments: str) -> tuple[str, ...]:
    """The command line that runs a module, named as after ``python -m``, by this interpreter."""
    return (sys.executable, "-P", "-m", module, *arguments)


def leave_working_folder_out() -> None:
    """Import nothing from the working folder, which ``python -m`` has put first, from now on.

    A checkout that is not installed stays importable from its own folder.
    """
    # Not by pathlib, of which there may be a decoy.
    own = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
    if not sys.flags.safe_path and sys.path[0] != own:
        del sys.path[0]


def keep_working_folder_out_of_workers() -> None:
    """Let interpreters that Python itself starts for this one, as for a pool, leave it out too."""
    os.environ["PYTHONSAFEPATH"] = "1"
