"""Limit BLAS to one thread: the dense blocks of an increment are small, and runs are parallel.

Several threads spend their time on synchronisation: on two busy cores a run took seven times as
long.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread."""
    return _controller().limit(limits=1, user_api="blas")
