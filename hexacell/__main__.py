"""``hexacell`` and ``python -m hexacell``."""

import sys
import warnings

from hexacell.cli import app


def main() -> int:
    """Run a command as a process of its own and return its exit code.

    Numpy's warnings concern developers: tests take them as errors, users do not see them.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore", RuntimeWarning)
    return app.main()


if __name__ == "__main__":
    sys.exit(main())
