"""Services for the tests.

Those that all tests share end with this folder: while they and their workers wait, they take 3 % of
a core.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.turns import Turn
from tests.service.servers import Server, worker_elsewhere


@pytest.fixture(scope="package")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One running service for all tests that leave it running; its worker stays between studies."""
    home = tmp_path_factory.mktemp("service")
    with worker_elsewhere(home) as address:
        settings = {"RESIDUA_SCHEDULER": address, "RESIDUA_READER_SECONDS": "60"}
        server = Server(home, settings=settings).start()
        yield server
        server.close()


@pytest.fixture(scope="package")
def lively(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One running service with a worker of its own for all tests that leave a service running.

    They may take down what it starts, which it starts again, and may stop or kill the service if
    they start it again. It does not wait for studies that hang, and tells soon how far one is.
    """
    settings = {"RESIDUA_GRACE_SECONDS": "1", "RESIDUA_POLL_SECONDS": "0.1"}
    server = Server(tmp_path_factory.mktemp("lively"), settings=settings).start()
    yield server
    server.close()


@pytest.fixture
def mortal(tmp_path: Path) -> Iterator[Server]:
    """A service of the test's own with its own workers, to be killed; not started yet."""
    server = Server(tmp_path / "mortal")
    yield server
    server.close()


@pytest.fixture
def computing_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute in threads of this process, which knows the fake scene."""

    async def apart(self: Turn, function: Any, *given: Any, **named: Any) -> Any:
        begun = time.monotonic()
        try:
            return await asyncio.to_thread(function, *given)
        finally:
            self.spent += time.monotonic() - begun

    monkeypatch.setattr(Turn, "apart", apart)
