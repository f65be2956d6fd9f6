"""Services for the tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.servers import Server


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One running service for all tests that leave it running."""
    server = Server(tmp_path_factory.mktemp("service")).start()
    yield server
    server.close()


@pytest.fixture
def mortal(tmp_path: Path) -> Iterator[Server]:
    """A service of the test's own, to be stopped and killed; not started yet."""
    server = Server(tmp_path / "mortal", workers=2)
    yield server
    server.close()
