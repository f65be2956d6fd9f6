"""One thread for linear algebra: several cost more than they give on small matrices."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="package")
def one_thread() -> Iterator[None]:
    """Keep numpy and scipy to one thread."""
    with threadpool_limits(1):
        yield
