"""The command as ``python -m residua``."""

from __future__ import annotations

import sys

from residua.cli import main

if __name__ == "__main__":
    sys.exit(main())
