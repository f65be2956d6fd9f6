"""Processes that begin at once: forks of one process that has loaded what they need.

To load solver and libraries takes longer than a small study. A process with one thread loads them,
computes nothing, and calls each function that it is asked to call in a fork of itself. It ends with
the process that started it, and its forks end with it.
"""

from __future__ import annotations

import atexit
import ctypes
import errno
import fcntl
import gc
import multiprocessing
import os
import pickle
import signal
import sys
import termios
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import recv_handle, send_handle
from pathlib import Path
from threading import Lock
from typing import Any

from solver.late import no_search
from solver.parts import SETTING, own_files
from studies.definition.identity import solver_hash

NEEDED = (
    "distributed.worker",
    "netCDF4",
    "h5py",
    "solver.contact.given_bound",
    "solver.linear.pardiso",
    "solver.results.solution",
    "solver.scenes.punch_setup",
    "studies.execution.grid",
    "studies.execution.task",
)
"""Modules that a worker needs; with them all that they import."""

FROM_THE_START: Mapping[str, int] = {
    # Runs share the cores: several threads of one would wait for each other.
    "OMP_NUM_THREADS": 1,
    "MKL_NUM_THREADS": 1,
    "OPENBLAS_NUM_THREADS": 1,
    # Arrays of some megabytes are allocated and freed in every iteration: with dask's threshold of
    # 64 kB each would return to the system, and clearing pages would take a quarter of the time.
    "MALLOC_TRIM_THRESHOLD_": 2**28,
    "MALLOC_MMAP_THRESHOLD_": 2**26,
}
"""Environment variables of a process, which are read when it starts or loads libraries."""

LOADING_SECONDS = 60.0
"""Longest time of loading, and of a fork [s]."""

_END_SECONDS = 5.0
"""Time in which the process ends of itself, with its forks [s]."""

_FORKS = "fork" if sys.platform == "linux" else "spawn"
"""Elsewhere a process that has loaded libraries cannot be forked safely."""
_DEATH_SIGNAL = 1
"""Option of ``prctl``."""
_NAME = "residua-fork"
"""Name of a process that has what is needed: it may be forked itself, while it has one thread."""


@dataclass(slots=True, eq=False)
class Fork:
    """A process that calls a function."""

    pid: int
    end: Connection
    _code: int | None = None

    @property
    def returncode(self) -> int | None:
        """Its exit status, None while it runs; 255 if the process that began it has ended."""
        if self._code is None and self.end.poll(0):
            try:
                self._code = self.end.recv()
            except (EOFError, OSError):
                self._code = 255
        return self._code

    def kill(self) -> None:
        """Kill it."""
        if self.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)


class Forks:
    """A process whose forks call functions; it is started when needed, and again if it ended."""

    def __init__(self, modules: Sequence[str] = NEEDED) -> None:
        self.modules = modules
        self._one = Lock()
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._loaded = False

    def prepare(self) -> None:
        """Begin to load, unless that has been done."""
        with self._one:
            self._there()

    def start(
        self,
        function: Callable[..., object],
        *given: object,
        pipes: Sequence[Connection] = (),
        module: str = "",
    ) -> Fork:
        """Call ``function(*pipes, *given)`` in a fork; a module is loaded for this one and others.

        Raises
        ------
        OSError
            if the system cannot start a process, or not in time
        """
        content = pickle.dumps((function, given))
        with self._one:
            try:
                return self._started(content, pipes, module)
            except EOFError:  # it may have been killed since the last call: another one is started
                self._end()
            try:
                return self._started(content, pipes, module)
            except EOFError:
                self._end()
                raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from None

    def _started(self, content: bytes, pipes: Sequence[Connection], module: str) -> Fork:
        """Return a fork; raise `EOFError` if the process that is forked has ended."""
        end, theirs = multiprocessing.Pipe(duplex=False)
        with theirs:
            pipe = self._there()
            try:
                if not self._loaded:
                    self._answer(pipe)
                    self._loaded = True
                pipe.send(({**os.environ, **_always()}, module, 1 + len(pipes)))
                pipe.send_bytes(content)
                for each in (theirs, *pipes):
                    send_handle(pipe, each.fileno(), None)
                return Fork(self._answer(pipe), end)
            except (BrokenPipeError, ConnectionResetError):
                raise EOFError from None

    def _answer(self, pipe: Connection) -> Any:
        if not pipe.poll(LOADING_SECONDS):
            self._end()
            raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
        return pipe.recv()

    def close(self) -> None:
        """End the process and its forks."""
        with self._one:
            self._end()

    def _there(self) -> Connection:
        if self._process and self._process.is_alive() and self._pipe:
            return self._pipe
        self._end()
        own = _FORKS == "fork" and multiprocessing.current_process().name == _NAME
        ours = own and len(list(Path("/proc/self/task").iterdir())) == 1
        context: Any = multiprocessing.get_context("fork" if ours else "spawn")
        pipe, theirs = multiprocessing.Pipe()
        given = theirs, pipe if ours else None, self.modules
        process = context.Process(target=_serve, args=given)
        # Before it knows the module path of this process, it would look in the current directory.
        with variables({**_always(), "PYTHONSAFEPATH": "1"}), interrupts_blocked(), theirs:
            process.start()
        atexit.register(self._end)
        self._process, self._pipe, self._loaded = process, pipe, False
        return pipe

    def _end(self) -> None:
        if self._pipe:
            self._pipe.close()
        if self._process:
            self._process.join(_END_SECONDS)
            self._process.kill()
            self._process.join()
        self._process = self._pipe = None
        atexit.unregister(self._end)


def _always() -> dict[str, str]:
    """Return the variables of forks that are not those of this process.

    They work in another folder: the names of a user's own files are whole.
    """
    own = {SETTING: os.pathsep.join(map(str, own_files()))} if own_files() else {}
    return {name: str(value) for name, value in FROM_THE_START.items()} | own


SHARED = Forks()
"""What the workers of this process are forks of."""


def _serve(pipe: Connection, other: Connection | None, modules: Sequence[str]) -> None:
    """Load modules, then call what is asked for in forks, until the other end of the pipe closes.

    The id of the solver is that of the sources which this process has loaded: one that begins after
    an update would find new sources on the disk. Each fork has the environment of the process that
    asks for it, when it asks. What is loaded stays: who
    looks for memory to free does not look there.
    """
    if other:
        other.close()
    os.chdir("/")  # no settings of libraries are read where this process was started
    with no_search():
        for module in modules:
            import_module(module)
        solver_hash()
        gc.freeze()
    context: Any = multiprocessing.get_context(_FORKS)
    forks: dict[int, tuple[BaseProcess, Connection]] = {}
    with suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            ready = wait([pipe, *forks])
            for each in forks.keys() & set(ready):
                fork, end = forks.pop(each)
                fork.join()
                os.close(each)
                with end, suppress(OSError):
                    end.send(fork.exitcode)
            if pipe in ready:
                fork, end = _begun(pipe, context)
                forks[_watched(fork)] = fork, end
    for fork, _ in forks.values():
        fork.kill()
    os._exit(0)


def _watched(fork: BaseProcess) -> int:
    """Return a file that can be read when a process has ended.

    That of `multiprocessing` can be read too when the process has closed its files.
    """
    try:
        return os.pidfd_open(fork.pid or 0)
    except (AttributeError, OSError):  # another system, or an old one
        return os.dup(fork.sentinel)


def _begun(pipe: Connection, context: Any) -> tuple[BaseProcess, Connection]:
    """Start what is asked for, and answer with its id."""
    environment, module, count = pipe.recv()
    content = pipe.recv_bytes()
    end, *pipes = [Connection(recv_handle(pipe)) for _ in range(count)]
    os.environ.clear()
    os.environ.update(environment)
    if module:
        with suppress(Exception), no_search():  # the fork will tell
            import_module(module)
        gc.freeze()
    given = [pipe, end] if _FORKS == "fork" else [], content, pipes
    fork: BaseProcess = context.Process(target=_call, args=given, name=_NAME)
    fork.start()
    for each in pipes:
        each.close()
    pipe.send(fork.pid)
    return fork, end


def _call(others: Sequence[Connection], content: bytes, pipes: Sequence[Connection]) -> None:
    """Call a function in a process that has just begun."""
    for other in others:
        other.close()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    os.setpgid(0, 0)  # not a session: Linux shares processors among sessions, however nice
    with suppress(OSError):  # there is a terminal, none of which is for this process
        terminal = os.open("/dev/tty", os.O_RDWR | os.O_CLOEXEC)
        fcntl.ioctl(terminal, termios.TIOCNOTTY)
        os.close(terminal)
    function, given = pickle.loads(content)
    try:
        function(*pipes, *given)
    finally:
        SHARED.close()  # or the end of this process would wait for it


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C for this thread, and for the threads and processes that it starts meanwhile.

    Ctrl-C reaches every process of the terminal, also one that has only just begun; only the
    calling process shall react to it.
    """
    resource_tracker.ensure_running()  # it would unblock Ctrl-C when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def variables(changes: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for the processes that are started meanwhile.

    Other variables are left alone, because other threads may read them.
    """
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
