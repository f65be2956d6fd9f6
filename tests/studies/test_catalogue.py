"""The catalogue while it is written, and after its writer was killed."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from studies import CatalogueDamaged
from studies.storage.catalogue import Catalogue

KILLED_WRITER = """
import os, sqlite3, sys
connection = sqlite3.connect(sys.argv[1])
connection.execute("PRAGMA cache_size = 1")
connection.execute("BEGIN")
for number in range(1000):
    row = [str(number), "fake", "ok", "x" * 500, "{}", "{}", "", "", 0.0, "", "", 0, 0, 0]
    connection.execute(f"INSERT OR REPLACE INTO runs VALUES ({', '.join('?' * 14)})", row)
os.kill(os.getpid(), 9)
"""
"""Fills so many pages that some reach the file before the transaction has ended."""


def row(run_id: str) -> dict[str, Any]:
    return {
        "id": run_id, "scene": "fake", "status": "ok", "message": "", "parameters": {},
        "scalars": {"increments": 7}, "path": "", "created": "", "cpu_seconds": 0.0,
        "solver_source": "", "keep": "", "size": 1, "modified": 2,
    }  # fmt: skip


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    return Catalogue(tmp_path / "catalogue.sqlite")


@pytest.fixture
def wounded(catalogue: Catalogue) -> Catalogue:
    """A catalogue of one row whose last writer was killed while it wrote a thousand."""
    catalogue.put([row("0")])
    size = catalogue.path.stat().st_size
    subprocess.run([sys.executable, "-c", KILLED_WRITER, catalogue.path], check=False)
    assert catalogue.path.with_name(f"{catalogue.path.name}-journal").stat().st_size > 0
    assert catalogue.path.stat().st_size > size
    return catalogue


READERS: dict[str, Callable[[Catalogue], Any]] = {
    "run": lambda catalogue: [catalogue.rows(["0"]).get("0")],
    "runs": lambda catalogue: catalogue.runs()[0],
    "rows": lambda catalogue: list(catalogue.rows(["0", "1"]).values()),
}


@pytest.mark.processes
@pytest.mark.parametrize("read", READERS.values(), ids=READERS.keys())
def test_the_first_reader_after_a_killed_writer_sees_what_was_committed(
    wounded: Catalogue, read: Callable[[Catalogue], Any]
) -> None:
    assert read(wounded) == [row("0")]
    assert set(wounded.stamps()) == {"0"}


@pytest.mark.processes
def test_many_first_readers_after_a_killed_writer_all_see_what_was_committed(
    wounded: Catalogue,
) -> None:
    with ThreadPoolExecutor(16) as pool:
        found = list(pool.map(lambda _: wounded.runs(), range(64)))
    assert found == [([row("0")], 1)] * 64


@pytest.mark.processes
def test_a_writer_goes_on_after_a_killed_one(wounded: Catalogue) -> None:
    wounded.put([row("1")])
    assert set(wounded.stamps()) == {"0", "1"}


def test_a_catalogue_that_cannot_be_written_to_is_read(catalogue: Catalogue) -> None:
    catalogue.put([row("0")])
    catalogue.path.chmod(0o444)
    assert catalogue.runs() == ([row("0")], 1)


def empty(catalogue: Catalogue) -> bool:
    return (
        catalogue.rows(["0"]).get("0") is None
        and catalogue.runs(scene="fake") == ([], 0)
        and catalogue.rows(["0"]) == {}
        and catalogue.stamps() == {}
    )


def test_nothing_written_yet_is_no_run_and_leaves_no_file(catalogue: Catalogue) -> None:
    assert empty(catalogue)
    assert list(catalogue.path.parent.iterdir()) == []


def test_a_file_whose_first_writer_was_killed_is_no_run(catalogue: Catalogue) -> None:
    catalogue.path.touch()
    assert empty(catalogue)
    assert catalogue.path.stat().st_size == 0
    catalogue.put([row("0")])
    assert set(catalogue.stamps()) == {"0"}


def test_readers_of_the_very_first_write_see_all_of_it_or_nothing(tmp_path: Path) -> None:
    catalogues = [Catalogue(tmp_path / f"{number}.sqlite") for number in range(20)]
    seen: list[int] = []

    def read() -> None:
        for catalogue in catalogues:
            while (count := catalogue.runs(limit=1)[1]) == 0:
                seen.append(count)
            seen.append(count)

    with ThreadPoolExecutor(1) as pool:
        reading = pool.submit(read)
        for catalogue in catalogues:
            catalogue.put(row(str(number)) for number in range(100))
        reading.result()
    assert set(seen) == {0, 100}


def test_what_is_no_catalogue_is_named_as_such(catalogue: Catalogue) -> None:
    catalogue.path.write_text("something else, and long enough to be a page of a database" * 20)
    with pytest.raises(CatalogueDamaged, match=r"catalogue\.sqlite .* not a database"):
        set(catalogue.stamps())


def test_the_last_page_of_a_hundred_thousand_runs_is_found_without_reading_them(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some steps of SQLite pass a run in an index; to read and sort runs takes a hundred each."""
    connect, thousands = sqlite3.connect, []

    def watched(*arguments: Any, **named: Any) -> sqlite3.Connection:
        connection = connect(*arguments, **named)
        connection.set_progress_handler(lambda: thousands.append(None), 1000)
        return connection

    catalogue.put(row(f"{i:032x}") | {"created": f"{i % 977:05}"} for i in range(100_000))
    monkeypatch.setattr("sqlite3.connect", watched)
    rows, total = catalogue.runs(limit=100, offset=99_900)
    assert 0 < len(thousands) < 800
    assert total == 100_000
    assert [each["created"] for each in rows] == ["00976"] * 100
    assert len(catalogue.rows(f"{i:032x}" for i in range(0, 100_000, 5))) == 20_000


def test_a_row_that_is_not_what_was_written_is_damage(catalogue: Catalogue) -> None:
    catalogue.put([row("0")])
    with closing(sqlite3.connect(catalogue.path)) as connection, connection:
        connection.execute("UPDATE runs SET scalars = replace(scalars, '7', '8')")
    for read in (*READERS.values(), Catalogue.stamps):
        with pytest.raises(CatalogueDamaged, match="row of run '0' is damaged"):
            read(catalogue)
