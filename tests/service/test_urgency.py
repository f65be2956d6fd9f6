"""Answers of the service come before what it computes."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

from service.processes import Starter
from studies.execution.forks import Forks


def main() -> None:
    """Say how urgent this process is, as a child of the service."""
    print(os.nice(0), flush=True)


def test_a_process_that_computes_is_less_urgent_than_the_service(tmp_path: Path) -> None:
    async def said() -> bytes:
        with (tmp_path / "lock").open("w") as lock:
            starter = Starter(lock.fileno(), Forks(("service.processes",)))
            process = await starter.start(main.__module__, {})
            async with asyncio.timeout(30.0):
                line = await process.stdout.readline()
                await process.wait()
            process.stdin.close()
            return line

    assert int(asyncio.run(said())) > os.nice(0)
