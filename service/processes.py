"""Child processes of the service, and the communication with them.

All are forks of one process. The end of its standard input means "stop" to each, whether the
service stops it or has died. It sends lines of JSON on its standard output. It inherits the lock of
the data directory until it ends: a service that starts after a crash waits for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import json
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TextIO

from service import logs
from solver.parts import SETTING, own_files
from studies.execution.forks import NEEDED, Fork, Forks

LONGEST_LINE = 10_000_000
"""Largest size of a message of a process [bytes]: of a search the ids of all runs are one."""

BEAT_SECONDS = 5.0
"""Time between two signs of life [s]; a process counts as frozen only after a longer time."""

LOADED = ("service.child", "service.pool", "studies.storage.combine")
"""Modules that are loaded before a process is forked, besides those that workers need."""

STDIN, STDOUT = 0, 1

BEHIND = 5
"""By how much computing is less urgent than answers: with it a processor that both want is mostly
for the answer."""

_SET_NAME = 15
"""Option of ``prctl``."""
_ARENA_MAX, _ARENAS = -8, 2
"""Option of ``mallopt``, and the value for it."""

HOME = Path(__file__).parents[1]
"""The folder of the packages."""


def find_modules_at_home() -> None:
    """Keep modules of this process and those it starts apart from where the service was started.

    Python looks for modules in the folder of a script, or in the current one, before all others: a
    file ``random.py`` there would be executed. What is started from now on finds what this process
    finds without that folder, and the user's own files wherever it works.
    """
    if not sys.flags.safe_path and Path(sys.path[0]).resolve() != HOME:
        del sys.path[0]
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["PYTHONPATH"] = os.pathsep.join(each or str(HOME) for each in sys.path)
    os.environ[SETTING] = os.pathsep.join(map(str, own_files()))


def share_arenas() -> None:
    """Let the threads of this process share what glibc keeps of the memory they have freed.

    Else each of some forty keeps as much as its largest answer took: in time, as many answers.
    """
    if sys.platform == "linux":
        with contextlib.suppress(AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_ARENA_MAX, _ARENAS)


@dataclass(slots=True, frozen=True)
class Process:
    """A process that this one has started.

    Attributes
    ----------
    fork : its end
    stdin, stdout : the pipe that tells it to stop, and what it writes
    """

    fork: Fork
    stdin: Connection
    stdout: asyncio.StreamReader

    @property
    def returncode(self) -> int | None:
        """Its exit status; None while it runs."""
        return self.fork.returncode

    async def wait(self) -> None:
        """Wait until it has ended."""
        while self.returncode is None:
            await asyncio.sleep(0.02)

    def kill(self) -> None:
        """Kill it."""
        self.fork.kill()


@dataclass(slots=True, frozen=True)
class Starter:
    """Starts processes as forks of one that has loaded what studies need: at once, not in seconds.

    Attributes
    ----------
    lock : number of the open file that locks the data directory
    """

    lock: int
    forks: Forks = field(default_factory=lambda: Forks((*LOADED, *NEEDED)))

    async def prepare(self) -> None:
        """Begin to load, unless that has been done."""
        await asyncio.to_thread(self.forks.prepare)

    async def start(self, module: str, order: Mapping[str, Any]) -> Process:
        """Return a process that executes ``main(order)`` of a module.

        Raises
        ------
        OSError
            If the system cannot start a process, or not in time.
        """
        theirs, stdin = multiprocessing.Pipe(duplex=False)
        stdout, out = multiprocessing.Pipe(duplex=False)
        pipes = theirs, out, Connection(os.dup(self.lock))
        begin = partial(self.forks.start, _begin, module, order, pipes=pipes)
        try:
            fork = await asyncio.to_thread(begin)
        finally:
            for each in pipes:
                each.close()
        loop, reader = asyncio.get_running_loop(), asyncio.StreamReader(LONGEST_LINE)
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), stdout)
        return Process(fork, stdin, reader)


def _begin(
    stdin: Connection, stdout: Connection, lock: Connection, module: str, order: Mapping[str, Any]
) -> None:
    """Execute ``main(order)`` of a module in a process that has just been started."""
    os.dup2(stdin.fileno(), STDIN)
    os.dup2(stdout.fileno(), STDOUT)
    stdin.close()
    stdout.close()
    name_process(module)
    os.nice(BEHIND)
    logs.configure(os.environ.get("RESIDUA_LOG_FORMAT", "plain"), study=order.get("id", ""))
    import_module(module).main(order)


def name_process(module: str) -> None:
    """Name this process after a module; all forks of a process have the same command line."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_NAME, module.encode())


async def end(process: Process, grace: float) -> None:
    """Stop a process by closing its input, and kill it if it does not end."""
    process.stdin.close()
    try:
        async with asyncio.timeout(grace):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()


class Outlet:
    """Sends messages to the service, one JSON text per line."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.one = threading.Lock()

    def send(self, kind: str, content: Mapping[str, Any]) -> None:
        """Write one message; if the service no longer reads, the work continues."""
        with contextlib.suppress(BrokenPipeError), self.one:
            self.stream.write(json.dumps({"kind": kind, "content": content}) + "\n")
            self.stream.flush()


def claim_stdout() -> Outlet:
    """Reserve the standard output for messages: output of libraries goes to the error output."""
    stream = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return Outlet(stream)


def beat(outlet: Outlet) -> None:
    """Send a sign of life at regular intervals, until the process ends."""

    def go_on() -> None:
        while True:
            outlet.send("alive", {})
            time.sleep(BEAT_SECONDS)

    threading.Thread(target=go_on, name="beat", daemon=True).start()


def watch_stdin(grace: float) -> threading.Event:
    """Return an event that is set when the other end of the standard input closes.

    A process that has not ended ``grace`` seconds later kills itself: a service that died cannot
    do it, and the next service waits for the lock.
    """
    stop = threading.Event()

    def watch() -> None:
        # Not through sys.stdin: at exit the interpreter would wait for its buffer's lock.
        os.read(STDIN, 1)
        stop.set()
        time.sleep(grace)
        os._exit(1)

    threading.Thread(target=watch, name="stop-watch", daemon=True).start()
    return stop
