"""Workers that are shared, frozen, refused, or not there."""

from __future__ import annotations

import itertools
import os
import pickle
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import dask
import psutil
import pytest
from distributed.system import MEMORY_LIMIT

from studies import Access, GridLost, Limits, StudyError, own_workers
from studies.execution import grid as grid_module
from studies.execution.executor import Event, Finished, Function, Message, StopCheck, Waiting
from studies.execution.forks import Fork, Forks, variables
from studies.execution.grid import Grid
from studies.execution.run import DEFAULT
from studies.execution.watch import Ticket
from studies.execution.workers import connect
from tests.studies.chores import chatter, freeze, nap, need

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def two() -> Iterator[Access]:
    with own_workers(2) as access:
        yield access


@pytest.fixture
def nobody() -> Iterator[Access]:
    """A scheduler without workers."""
    with own_workers(0) as access:
        yield access


def never() -> bool:
    return False


def run(
    grid: Grid,
    function: Function,
    tasks: Iterable[Any],
    should_stop: StopCheck,
    limits: Limits = DEFAULT,
    *,
    priority: int = 0,
    hear: Callable[[Event], None] | None = None,
) -> list[Event]:
    """Run tasks, and return what happened."""
    events: list[Event] = []
    grid.run(function, tasks, hear or events.append, should_stop, limits, priority)
    return events


def workers() -> list[psutil.Process]:
    """The worker processes of this process, which has other children too."""
    return [
        each
        for server in psutil.Process().children()
        if "spawn_main" in " ".join(server.cmdline())
        for each in server.children()
    ]


def listening() -> list[Any]:
    """Ports that this process and its workers listen on."""
    family = [psutil.Process(), *workers()]
    return [
        each.laddr
        for process in family
        for each in process.net_connections("tcp")
        if each.status == psutil.CONN_LISTEN
    ]


def test_who_lacks_the_credentials_is_refused_at_once(two: Access) -> None:
    with own_workers(0) as other:
        stranger = Access(two.address, other.ca, other.cert, other.key)
        for access in (Access(two.address.replace("tls:", "tcp:")), stranger):
            with pytest.raises(GridLost) as caught:
                connect(access)
            assert "imed out" not in str(caught.value)
    with connect(pickle.loads(pickle.dumps(two))) as friend:
        assert len(friend.nthreads()) == 2


def test_all_ports_are_on_the_loopback_and_show_no_pages(two: Access) -> None:
    ports = listening()
    assert len(ports) >= 5
    assert {each.ip for each in ports} == {"127.0.0.1"}
    pages = ("", "info/main/workers.html", "json/identity.json", "metrics", "health", "status")
    for port in {each.port for each in ports}:
        for page in pages:
            with pytest.raises((urllib.error.URLError, OSError)):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=5)


def test_credentials_are_in_no_argument_environment_or_file(two: Access) -> None:
    assert two.key
    secret = two.key.splitlines()[5]
    assert secret not in repr(two)
    for process in psutil.Process().children(recursive=True):
        assert secret not in " ".join(process.cmdline())
        assert secret not in " ".join(process.environ().values())
        names = [Path(each.path) for each in process.open_files()]
        assert not [name for name in names if secret.encode() in name.read_bytes()]


def test_workers_of_our_own_get_the_memory_that_is_set() -> None:
    with own_workers(1, "700MB") as access, connect(access) as client:
        (worker,) = client.scheduler_info()["workers"].values()
    assert worker["memory_limit"] == 700_000_000


def test_no_more_workers_are_started_than_memory_bears() -> None:
    with own_workers(3, need=MEMORY_LIMIT * 2 // 3) as access, connect(access) as client:
        (worker,) = client.scheduler_info()["workers"].values()
    assert worker["memory_limit"] == MEMORY_LIMIT


def test_workers_are_forks_of_one_process_and_have_the_environment_of_their_own_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def environment() -> dict[str, str]:
        return dict(os.environ)

    found = []
    for change in ({"RESIDUA_LINEAR_SOLVER": "superlu"}, {"OMP_NUM_THREADS": "4"}):
        with monkeypatch.context() as patch:
            for name, value in change.items():
                patch.setenv(name, value)
            expected = {**os.environ, "OMP_NUM_THREADS": "1"}
            with own_workers(1) as access, connect(access) as client:
                (worker,) = workers()[-1:]
                found.append(worker.ppid())
                (seen,) = client.run(environment).values()
                preloads = dask.config.get("distributed.worker.preload")
                assert preloads == [], "its text is a file that others can read"
        assert {name: seen.get(name) for name in expected} == expected
        assert seen.get("RESIDUA_LINEAR_SOLVER") == change.get("RESIDUA_LINEAR_SOLVER")
        assert seen["MALLOC_TRIM_THRESHOLD_"] == str(2**28)
    assert found[0] == found[1] != os.getpid()


def test_variables_are_set_for_a_while_and_others_are_left_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    with variables({"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}):
        assert dict(os.environ) == {**before, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    assert dict(os.environ) == before


def test_certificates_that_are_missing_or_bad_are_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="needs certificates"):
        Access("tls://127.0.0.1:1")
    (tmp_path / "bad.pem").write_text("no certificate")
    bad = str(tmp_path / "bad.pem")
    with pytest.raises(StudyError, match=r"certificates = .*bad.pem.*cannot be used"):
        connect(Access("tls://127.0.0.1:1", bad, bad, bad))


def test_one_task_is_served_beside_a_thousand_of_another(two: Access) -> None:
    drawn, done = itertools.count(), itertools.count()
    leave = threading.Event()
    begun = threading.Event()

    def many() -> None:
        tasks = (0.1 for _ in range(1000) if next(drawn) >= 0)
        with Grid(two) as grid:

            def hear(item: Any) -> None:
                if isinstance(item, Finished) and next(done) == 4:
                    begun.set()

            run(grid, nap, tasks, leave.is_set, hear=hear)

    crowd = threading.Thread(target=many)
    crowd.start()
    try:
        assert begun.wait(60)
        with Grid(two) as grid:
            before = next(done)
            assert [type(each) for each in run(grid, nap, [0.0], never)] == [Message, Finished]
            assert next(done) - before < 20
        assert next(drawn) <= next(done) + 10, "tasks are built when their turn comes"
    finally:
        leave.set()
        crowd.join(30)
    assert not crowd.is_alive()


def test_who_has_just_come_goes_before_what_another_keeps_in_stock(two: Access) -> None:
    order: list[str] = []

    def many(grid: Grid) -> None:

        def hear(item: Any) -> None:
            if isinstance(item, Finished):
                order.append("stock")

        run(grid, nap, [0.4, 1.0] * 4, never, hear=hear)

    with Grid(two) as stock, Grid(two) as new:
        crowd = threading.Thread(target=many, args=(stock,))
        crowd.start()
        while not order:  # two run, two wait
            time.sleep(0.01)
        began = len(order)

        def hear(item: Any) -> None:
            if isinstance(item, Finished):
                order.append("new")

        run(new, nap, [0.0], never, hear=hear)
        crowd.join(30)
    assert order.index("new") - began <= 2, "those that were running, and no more"


def test_the_higher_priority_goes_first(two: Access) -> None:
    order: list[str] = []

    def study(grid: Grid, name: str, priority: int) -> None:

        def hear(item: Any) -> None:
            if isinstance(item, Finished):
                order.append(name)

        run(grid, nap, [0.3] * 8, never, priority=priority, hear=hear)

    with Grid(two) as low, Grid(two) as high:
        first = threading.Thread(target=study, args=(low, "low", 0))
        first.start()
        while not order:
            time.sleep(0.01)
        study(high, "high", 1)
        first.join(30)
    last_high = max(i for i, name in enumerate(order) if name == "high")
    assert order[:last_high].count("low") <= 4, "those that were running, and no more"


def test_a_frozen_worker_is_replaced_and_others_are_not_blamed(two: Access) -> None:
    frozen: list[int] = []
    ends: dict[Any, Finished] = {}
    tasks = [("freeze", 0.0), *(("nap", 0.1 + i / 100) for i in range(12))]
    with Grid(two) as grid:

        def hear(item: Any) -> None:
            if isinstance(item, Message) and "seconds" not in item.content:
                frozen.append(item.content["pid"])
            elif isinstance(item, Finished):
                ends[item.task] = item

        run(grid, freeze, tasks, never, Limits(stall_seconds=2.0), hear=hear)
        assert set(ends) == set(tasks)
        failed = {task: str(end.error) for task, end in ends.items() if end.error}
        assert failed == {
            ("freeze", 0.0): "the loading path made no progress for 2 s (limit stall_seconds); "
            "its worker was replaced"
        }
        pids = {
            item.content["pid"]
            for item in run(grid, nap, [1.0] * 6, never)
            if isinstance(item, Message)
        }
        assert frozen[0] not in pids
    assert not psutil.pid_exists(frozen[0])


def test_a_frozen_worker_is_not_replaced_before_its_path_is_dropped(
    two: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or another worker would take the path, and freeze too."""
    drop, frozen = grid_module._drop, list[int]()

    def later(ticket: Ticket) -> None:
        threading.Timer(1.0, drop, [ticket]).start()

    monkeypatch.setattr(grid_module, "_drop", later)

    def hear(item: Any) -> None:
        if isinstance(item, Message):
            frozen.append(item.content["pid"])

    with Grid(two) as grid:
        run(grid, freeze, [("freeze", 0.0)], never, Limits(stall_seconds=2.0), hear=hear)
        pids = {
            item.content["pid"]
            for item in run(grid, nap, [0.5] * 4, never, Limits(patience=10.0))
            if isinstance(item, Message)
        }
    assert len(frozen) == 1 and frozen[0] not in pids
    assert not psutil.pid_exists(frozen[0])


def test_a_path_that_takes_too_long_is_ended_though_it_reports(two: Access) -> None:
    with Grid(two) as grid:
        limits = Limits(stall_seconds=5.0, path_seconds=1.0)
        *_, end = run(grid, chatter, [0.0], never, limits)
    assert isinstance(end, Finished)
    assert "took longer than 1 s (limit path_seconds)" in str(end.error)


def test_time_in_the_queue_does_not_count(two: Access) -> None:
    with Grid(two) as grid:
        limits = Limits(stall_seconds=3.0, path_seconds=3.0)
        ends = [e for e in run(grid, nap, [0.7] * 10, never, limits) if isinstance(e, Finished)]
    assert [end.error for end in ends] == [None] * 10


def test_stopping_does_not_wait_for_a_frozen_worker(two: Access) -> None:
    frozen, ended = list[int](), list[Finished]()
    with Grid(two) as grid:
        tasks = [("freeze", 0.0), ("nap", 600.0)]

        def hear(item: Any) -> None:
            if isinstance(item, Message) and "seconds" not in item.content:
                stopped = psutil.Process(item.content["pid"])
                while stopped.status() != psutil.STATUS_STOPPED:
                    time.sleep(0.01)
                frozen.append(stopped.pid)
            elif isinstance(item, Finished):
                ended.append(item)

        run(grid, freeze, tasks, lambda: bool(frozen), hear=hear)
        assert frozen and not [end for end in ended if not end.error], "no task came to its end"
    os.kill(frozen[0], 9)


def test_no_worker_is_told_and_ends_by_a_setting(
    nobody: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.watch._QUIET", 1.0)
    told = []
    with Grid(nobody) as grid, pytest.raises(GridLost, match="no worker is connected"):
        run(grid, nap, [0.0], never, Limits(patience=3.0), hear=told.append)
    (item,) = told
    assert isinstance(item, Waiting)
    assert item.reason.startswith("no worker is connected to the scheduler: start one")


def test_workers_killed_on_sight_are_told_and_the_study_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("studies.execution.watch._QUIET", 4.0)
    monkeypatch.setattr("studies.execution.workers._ABSENT", 8.0)
    hunted, start, forks = threading.Event(), Forks.start, list[Fork]()

    def started(self: Forks, *given: Any, **more: Any) -> Fork:
        forks.append(start(self, *given, **more))
        if hunted.is_set():
            forks[-1].kill()  # before it can take a task
        return forks[-1]

    monkeypatch.setattr(Forks, "start", started)
    with own_workers(1) as access, Grid(access) as grid:
        hunted.set()
        for fork in forks:
            fork.kill()
        items = []

        def hear(item: Any) -> None:
            items.append(item)
            if isinstance(item, Waiting) and item.reason:
                hunted.clear()

        run(grid, nap, [0.5, 0.5], never, Limits(patience=120.0), hear=hear)
    waits = [item.reason for item in items if isinstance(item, Waiting)]
    assert waits[0].startswith("no worker is connected to the scheduler")
    assert waits[-1] == ""
    assert [item.error for item in items if isinstance(item, Finished)] == [None, None]


def test_a_worker_that_is_not_fit_is_told_and_its_task_is_kept(two: Access, tmp_path: Path) -> None:
    file = tmp_path / "needed"
    items = []
    with Grid(two) as grid:

        def hear(item: Any) -> None:
            items.append(item)
            if isinstance(item, Waiting) and item.reason:
                assert item.reason.startswith("the worker tls://127.0.0.1:")
                assert item.reason.endswith(" lacks the file")
                file.touch()

        run(grid, need, [str(file)], never, hear=hear)
    assert [type(item) for item in items][-3:] == [Waiting, Message, Finished]
    assert items[-1].error is None
    assert items[-3].reason == ""


def test_time_for_which_the_caller_was_held_up_is_not_the_tasks(
    two: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.grid._HELD_UP", 1.5)
    with Grid(two) as grid:
        limits = Limits(stall_seconds=2.5, patience=2.5)
        items = []

        def hear(item: Any) -> None:
            if not items:
                time.sleep(4.0)
            items.append(item)

        run(grid, nap, [1.5] * 6, never, limits, hear=hear)
    assert [item.error for item in items if isinstance(item, Finished)] == [None] * 6
