"""``hexacell`` and ``python -m hexacell``."""

from __future__ import annotations

import sys

from hexacell.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
