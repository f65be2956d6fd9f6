"""How a command ends: its exit status, and what it says when something went wrong."""

from __future__ import annotations

import sys

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def complain(reason: object, status: int) -> int:
    """Say why a command ends, and return its exit status."""
    print(f"residua: {reason}", file=sys.stderr)
    return status
