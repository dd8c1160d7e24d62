"""``hexacell`` and ``python -m hexacell``."""

from __future__ import annotations

import sys
import warnings

from hexacell.cli import app


def main() -> int:
    """Run a command as a process of its own and return its exit code.

    What numpy has to say of a number concerns developers: tests take it as an error, users do not see it.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore", RuntimeWarning)
    return app.main()


if __name__ == "__main__":
    sys.exit(main())
