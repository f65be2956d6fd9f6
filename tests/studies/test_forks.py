"""The process whose forks are the workers: what they inherit, and how it ends."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from multiprocessing import Pipe, current_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Self

import dask
import psutil
import pytest

from studies.definition.identity import solver_hash
from studies.execution import workers
from studies.execution.forks import Forks
from studies.execution.workers import own_workers
from tests.architecture.sources import ROOT

pytestmark = pytest.mark.processes


@pytest.fixture
def forks() -> Iterator[Forks]:
    one = Forks(("json",))
    yield one
    one.close()


def report(pipe: Connection, deep: bool = False) -> None:
    """Send what a fork has; a deep one sends what a fork of it has."""
    if deep:
        own = Forks(("no_such_module",))  # as a fork of this process it has the modules
        own.modules = ()
        own.start(report, pipes=(pipe,)).end.poll(30.0)
        own.close()
        return
    files = [str(each.readlink()) for each in Path("/proc/self/fd").iterdir() if each.exists()]
    pipe.send(
        {
            "hashed": solver_hash.cache_info().currsize,
            "secret": any("secret" in file for file in files),
            "folder": str(Path.cwd()),
            "variable": os.environ.get("FOR_FORKS"),
            "threads": os.environ["OMP_NUM_THREADS"],
            "name": current_process().name,
        }
    )


@pytest.mark.parametrize("deep", [False, True])
def test_a_fork_has_what_was_loaded_and_the_environment_of_its_time(
    deep: bool, forks: Forks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No file of the process that starts it is among its own: not even of a fork of a fork."""
    receiver, sender = Pipe(duplex=False)
    forks.prepare()
    monkeypatch.setenv("FOR_FORKS", "told")
    with (tmp_path / "secret").open("w"), sender:
        fork = forks.start(report, deep, pipes=(sender,))
    assert receiver.recv() == {
        "hashed": 1, "secret": False, "folder": "/", "variable": "told", "threads": "1",
        "name": "residua-fork",
    }  # fmt: skip
    fork.end.poll(30.0)
    assert fork.returncode == 0


def test_forks_end_with_their_process_and_the_next_has_another(forks: Forks) -> None:
    one = forks.start(time.sleep, 60.0)
    parent = psutil.Process(one.pid).parent()
    assert parent is not None and one.returncode is None
    parent.kill()
    assert one.end.poll(30.0) and one.returncode == 255
    parent.wait(30.0)
    other = forks.start(os._exit, 3)
    assert other.end.poll(30.0) and other.returncode == 3
    killed = forks.start(time.sleep, 60.0)
    killed.kill()
    assert killed.end.poll(30.0) and killed.returncode == -signal.SIGKILL


PROGRAM = """
import os, sys, threading, time
from studies.execution.forks import Forks
if __name__ == "__main__":
    forks = Forks(())
    print(forks.start(time.sleep, 60.0).pid, flush=True)
    os._exit(0) if "at once" in sys.argv else None
"""


@pytest.mark.parametrize("words", ["at once", "in order"])
def test_no_fork_outlives_the_process_that_asked_for_it(words: str, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, "program.py", words]
    given = {"env": os.environ | {"PYTHONPATH": str(ROOT)}, "cwd": tmp_path}
    done = subprocess.run(command, capture_output=True, check=True, timeout=60, **given)
    fork = json.loads(done.stdout)
    until = time.monotonic() + 10.0
    while psutil.pid_exists(fork) and time.monotonic() < until:
        time.sleep(0.01)
    assert not psutil.pid_exists(fork)


def test_workers_end_though_ctrl_c_comes_while_they_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their start ends after the caller has reacted; their folder is there until they have ended.

    The signal is noted by another thread, as if it had come just before the caller waits.
    """
    ended: list[bool] = []
    reacted = threading.Event()

    def interrupted(*_: object) -> None:
        reacted.set()
        raise KeyboardInterrupt

    class Starting:
        def __init__(self, **_: object) -> None:
            self.folder = Path(dask.config.get("temporary-directory"))
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)
            self.reacted = reacted.wait(60.0)

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *error: object) -> None:
            ended.append(self.reacted and self.folder.is_dir())

    monkeypatch.setattr(workers, "LocalCluster", Starting)
    before = signal.signal(signal.SIGINT, interrupted)
    try:
        with pytest.raises(KeyboardInterrupt), own_workers(1):
            pytest.fail("they had started")
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [True]


def terminal(pipe: Connection) -> None:
    """Send whether this process has a terminal, and its session."""
    try:
        Path("/dev/tty").open().close()
        pipe.send([True, os.getsid(0)])
    except OSError:
        pipe.send([False, os.getsid(0)])


ON_A_TERMINAL = """
import json, os
from multiprocessing import Pipe
from studies.execution.forks import Forks
from tests.studies.test_forks import terminal
if __name__ == "__main__":
    open("/dev/tty").close()
    ours, theirs = Pipe(duplex=False)
    forks = Forks(())
    forks.start(terminal, pipes=(theirs,))
    print(json.dumps([ours.recv(), os.getsid(0)]))
    forks.close()
"""


def test_a_fork_stays_in_the_session_and_cannot_type_into_its_terminal(tmp_path: Path) -> None:
    """Of sessions, Linux does not ask how nice their processes are."""
    (tmp_path / "program.py").write_text(ON_A_TERMINAL)
    ours, theirs = os.openpty()
    done = subprocess.run(
        [sys.executable, str(tmp_path / "program.py")],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, stdin=theirs, capture_output=True, text=True,
        check=True, timeout=60, start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    os.close(ours)
    os.close(theirs)
    (has_terminal, session), own = json.loads(done.stdout)
    assert session == own
    assert not has_terminal
