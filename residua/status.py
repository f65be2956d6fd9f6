"""Exit statuses of the command, and its message on an error."""

from __future__ import annotations

import sys

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def complain(reason: object, status: int) -> int:
    """Print why a command ends, and return its exit status."""
    print(f"residua: {reason}", file=sys.stderr)
    return status
