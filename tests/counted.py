"""Work counted in function calls, which are the same on every machine."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True)
class Calls:
    """Number of function calls, of Python and of C, while they were counted."""

    count: int = 0

    def __lt__(self, most: int) -> bool:
        return self.count < most


@contextmanager
def counted() -> Iterator[Calls]:
    """Count the calls of this thread within the context."""
    found = Calls()

    def hear(frame: object, event: str, argument: object) -> None:
        found.count += event in ("call", "c_call")

    sys.setprofile(hear)
    try:
        yield found
    finally:
        sys.setprofile(None)
