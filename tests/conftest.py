"""Hooks and fixtures of all tests."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from tests.marks import allowed, of_folder
from tests.order import Order, place, turned
from tests.programs import Programs

if TYPE_CHECKING:
    from xdist.remote import Producer

    from studies import Access

# Workers of the test run share the cores: threads of BLAS would wait for each other. This is set
# before any test loads the library; processes that tests start inherit it.
os.environ["OMP_NUM_THREADS"] = "1"

# Hundreds of processes import the project: without compiled files each would take 0.15 s longer.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

_SOLVED = ("tests.verification", "tests.solver", "tests.stability.kinds", "tests.stability.test_")
"""Starts of the names of modules whose caches hold solved problems."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return the number of test processes: one a core, and one more where tests that wait run."""
    return len(os.sched_getaffinity(0)) + ("not processes" not in config.getoption("markexpr"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Order | None:
    """Hand out files whole, and those that share services together."""
    return Order(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Keep the thousands of collected tests out of each search for garbage: 2 % of all time."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl
def pytest_collection(session: pytest.Session) -> None:
    """Let each test process begin with other files: what one has compiled the others only load.

    No garbage is searched for until all tests are collected: there is hardly any.
    """
    gc.disable()
    config = session.config
    of_worker = getattr(config, "workerinput", None)
    if of_worker and config.args_source is config.ArgsSource.TESTPATHS:
        number = int(of_worker["workerid"].removeprefix("gw"))
        config.args = [str(each) for each in turned(number / of_worker["workercount"])]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files in their place; add the marks of folders before tests are selected by marks."""
    items.sort(key=lambda item: (place(item.path), item.path.parts))
    for item in items:
        for mark in of_folder(item.path):
            item.add_marker(mark)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Refuse expensive functions to a test and its fixtures if the test lacks the mark for them."""
    with allowed({mark.name for mark in item.iter_markers()}):
        return (yield)


@pytest.fixture(autouse=True, scope="module")
def nothing_solved_outlives_its_module() -> Iterator[None]:
    """Clear caches of solved problems, which hold factors of hundreds of megabytes.

    The solver keeps nothing either, and memory that is free is given back.
    """
    yield
    for name, module in list(sys.modules.items()):
        if name.startswith(_SOLVED):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear") and value.__module__.startswith("tests."):
                    value.cache_clear()
    if memory := sys.modules.get("solver.memory"):
        memory.release(0)


@pytest.fixture(autouse=True, scope="session")
def no_settings_from_outside() -> Iterator[None]:
    """Remove ``RESIDUA_`` settings of the user's environment."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith("RESIDUA_")]:
            patch.delenv(name)
        yield


@pytest.fixture(autouse=True, scope="session")
def records_are_compared() -> Iterator[None]:
    """Compare every record that a test makes with own values of its declared quantities."""
    from tests.recomputed import compared

    with compared():
        yield


@pytest.fixture(scope="session")
def programs() -> Iterator[Programs]:
    """What runs a file of Python in a process of its own, without loading libraries each time."""
    with Programs() as running:
        yield running


@pytest.fixture(scope="session")
def lasting_worker() -> Iterator[Access]:
    """One worker for all tests that do not test the start and end of workers."""
    from distributed import scheduler

    from studies import own_workers

    with pytest.MonkeyPatch.context() as patch:
        # While it waits, a sign of life each 0.5 s, as dask has it, would take 2 % of a core.
        patch.setattr(scheduler, "heartbeat_interval", lambda workers: 5.0)
        with own_workers(1) as access:
            yield access


@pytest.fixture(scope="module")
def one_worker(request: pytest.FixtureRequest) -> Iterator[None]:
    """Let studies that start one worker use the lasting one, as a start takes 3 s of CPU."""
    from studies.execution import run

    own_workers = run.own_workers

    @contextmanager
    def shared(workers: int, memory: str | None = None, need: int = 0) -> Iterator[Access]:
        if (workers, memory) == (1, None):
            yield request.getfixturevalue("lasting_worker")
        else:
            with own_workers(workers, memory, need) as access:
                yield access

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "own_workers", shared)
        yield
