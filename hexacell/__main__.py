"""``hexacell`` and ``python -m hexacell``."""

import sys
import warnings

from hexacell.python_process import leave_working_folder_out


def main() -> int:
    """Run a command as a process of its own and return its exit code.

    Numpy's warnings concern developers: tests take them as errors, users do not see them.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore", RuntimeWarning)
    from hexacell.cli import app  # noqa: PLC0415 - only after the working folder is left out

    return app.main()


if __name__ == "__main__":
    leave_working_folder_out()
    sys.exit(main())
