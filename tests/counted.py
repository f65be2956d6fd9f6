"""Work counted in function calls, which are the same on every machine, and its growth in time.

A call of a library that takes long counts once: what it takes is told by its growth alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
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


def growth(work: Callable[[int], object], length: int) -> float:
    """Return how many times longer work takes for four times a length: 16 with its square."""

    def seconds(length: int) -> float:
        began = time.process_time()
        work(length)
        return time.process_time() - began

    few, many = (min(seconds(each) for _ in range(3)) for each in (length, 4 * length))
    return many / few
