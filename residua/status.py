"""Exit statuses of the command, and its message on an error."""

from __future__ import annotations

import sys

LONGEST = 100_000
"""Number of characters of the message."""

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def complain(reason: object, status: int) -> int:
    """Print why a command ends, and return its exit status."""
    # without imports, see `wrong_package`
    print(f"residua: {str(reason)[:LONGEST]}", file=sys.stderr)
    return status
