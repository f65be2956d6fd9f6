"""Processes of the service: how urgent they are, and where they find its results."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from service.processes import Starter
from service.settings import Settings
from service.view import ViewedFolder
from studies.execution.forks import Forks
from tests.service.servers import PATIENCE


def main(order: object) -> None:
    """Say how urgent this process is, as a child of the service."""
    print(os.nice(0), flush=True)


def test_a_process_that_computes_is_less_urgent_than_the_service(tmp_path: Path) -> None:
    async def said() -> bytes:
        with (tmp_path / "lock").open("w") as lock:
            starter = Starter(lock.fileno(), Forks(("service.processes",)))
            process = await starter.start(main.__module__, {})
            async with asyncio.timeout(PATIENCE):
                line = await process.stdout.readline()
                await process.wait()
            process.stdin.close()
            return line

    assert int(asyncio.run(said())) == min(os.nice(0) + 5, 19)


def test_a_folder_is_the_same_for_processes_that_work_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `residua serve --data out` and `residua view out`: no reader works where they began."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out" / "aside").mkdir(parents=True)
    assert Settings(data=Path("out")).data == tmp_path / "out"
    assert ViewedFolder(Path("out"), Path("out/aside")).store.directory == tmp_path / "out"
