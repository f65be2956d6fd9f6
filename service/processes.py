"""Child processes of the service, and the communication with them.

A process gets its order as the first line of its standard input. The end of that input means
"stop", whether the service stops it or has died. It sends lines of JSON on its standard output. It
inherits the lock of the data directory until it ends: a service that starts after a crash waits for
it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import threading
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from service import logs
from solver.parts import SETTING, own_files

LONGEST_LINE = 1_000_000
"""Largest size of a message of a process [bytes]."""

BEAT_SECONDS = 5.0
"""Time between two signs of life [s]; a process counts as frozen only after a longer time."""

STDIN = 0

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


async def start(module: str, lock: int, *arguments: str) -> Process:
    """Start ``python -m module``; it loads its modules, then waits for its order.

    Raises
    ------
    OSError
        If the system cannot start a process.
    """
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        *arguments,
        stdin=PIPE,
        stdout=PIPE,
        limit=LONGEST_LINE,
        cwd="/",  # it reads no settings of libraries where the service was started
        pass_fds=(lock,),
        start_new_session=True,  # the service handles an interrupt from a terminal
    )


def send(process: Process, order: Mapping[str, Any]) -> None:
    """Send a process its order."""
    assert process.stdin is not None
    process.stdin.write(json.dumps(order).encode() + b"\n")


async def end(process: Process, grace: float) -> None:
    """Stop a process by closing its input, and kill it if it does not end."""
    assert process.stdin is not None
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


def read_order() -> dict[str, Any]:
    """Return the order, the first line of the standard input, and configure the log."""
    text = b""
    while not text.endswith(b"\n"):
        piece = os.read(STDIN, 65536)
        if not piece:
            raise SystemExit(0)  # the input has ended without an order
        text += piece
    order: dict[str, Any] = json.loads(text)
    logs.configure(os.environ.get("RESIDUA_LOG_FORMAT", "plain"), study=order.get("id", ""))
    return order


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


@dataclass(slots=True)
class Starter:
    """Starts processes of one module in advance, because loading takes a second or two.

    Attributes
    ----------
    module, lock, arguments : as for `start`
    """

    module: str
    lock: int
    arguments: tuple[str, ...] = ()
    _ready: Process | None = None
    _starting: bool = False

    async def prepare(self) -> None:
        """Start the next process, unless there is one; if that fails, `give` starts it."""
        if self._ready is None and not self._starting:
            self._starting = True
            with contextlib.suppress(OSError):
                self._ready = await start(self.module, self.lock, *self.arguments)
            self._starting = False

    async def give(self, order: Mapping[str, Any]) -> Process:
        """Return a process that has received this order.

        Raises
        ------
        OSError
            If the system cannot start one.
        """
        process, self._ready = self._ready, None
        if process is None or process.returncode is not None:
            process = await start(self.module, self.lock, *self.arguments)
        send(process, order)
        return process

    async def close(self) -> None:
        """End the process that waits for an order."""
        process, self._ready = self._ready, None
        if process is not None:
            await end(process, 1.0)
