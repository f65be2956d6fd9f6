"""Processes of the service's own, and how the two sides talk.

A process gets its order as the first line of its standard input; the end of that input means
"stop", whether the service stops it or died. It sends lines of JSON on its standard output.
It inherits the lock of the data directory and holds it until it ends: a service that starts after
a crash waits for it.
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
from typing import Any, TextIO

from service import logs

LONGEST_LINE = 1_000_000
"""Bytes of one message a process may send."""

BEAT_SECONDS = 5.0
"""Time between two signs of life; who takes a process for frozen must wait for longer."""

STDIN = 0


async def start(module: str, lock: int) -> Process:
    """Start ``python -m module``; it loads what it needs, then waits for its order.

    Raises
    ------
    OSError
        If the system cannot start a process.
    """
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        stdin=PIPE,
        stdout=PIPE,
        limit=LONGEST_LINE,
        pass_fds=(lock,),
        start_new_session=True,  # an interrupt from a terminal is the service's to handle
    )


def send(process: Process, order: Mapping[str, Any]) -> None:
    """Send a process its order."""
    assert process.stdin is not None
    process.stdin.write(json.dumps(order).encode() + b"\n")


async def end(process: Process, grace: float) -> None:
    """Ask a process to stop by closing its input, and kill it when it does not."""
    assert process.stdin is not None
    process.stdin.close()
    try:
        async with asyncio.timeout(grace):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()


class Outlet:
    """Sends messages to the service, one JSON text a line."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.one = threading.Lock()

    def send(self, kind: str, content: Mapping[str, Any]) -> None:
        """Write one message; when the service no longer reads, the work goes on."""
        with contextlib.suppress(BrokenPipeError), self.one:
            self.stream.write(json.dumps({"kind": kind, "content": content}) + "\n")
            self.stream.flush()


def claim_stdout() -> Outlet:
    """Keep the standard output for messages: what libraries print goes to the error output."""
    stream = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return Outlet(stream)


def beat(outlet: Outlet) -> None:
    """Say now and then that this process is alive, as long as it is."""

    def go_on() -> None:
        while True:
            outlet.send("alive", {})
            time.sleep(BEAT_SECONDS)

    threading.Thread(target=go_on, name="beat", daemon=True).start()


def read_order() -> dict[str, Any]:
    """Return the order, the first line of the standard input; from then on the log is ready."""
    text = b""
    while not text.endswith(b"\n"):
        piece = os.read(STDIN, 65536)
        if not piece:
            raise SystemExit(0)  # nothing to do: nobody has sent an order, or will
        text += piece
    order: dict[str, Any] = json.loads(text)
    logs.configure(os.environ.get("RESIDUA_LOG_FORMAT", "plain"), study=order.get("id", ""))
    return order


def watch_stdin(grace: float) -> threading.Event:
    """Return an event that is set when the other end of the standard input closes.

    A process that has not ended ``grace`` seconds later ends itself: a service that died cannot
    kill it, and the next one waits for its lock.
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
    """Starts processes of one module, each before it is needed: to load takes a second or two.

    Attributes
    ----------
    module, lock : as for `start`
    """

    module: str
    lock: int
    _ready: Process | None = None
    _starting: bool = False

    async def prepare(self) -> None:
        """Start the next process, unless it is there already; where that fails, `give` does."""
        if self._ready is None and not self._starting:
            self._starting = True
            with contextlib.suppress(OSError):
                self._ready = await start(self.module, self.lock)
            self._starting = False

    async def give(self, order: Mapping[str, Any]) -> Process:
        """Return a process that has this order.

        Raises
        ------
        OSError
            If the system cannot start one.
        """
        process, self._ready = self._ready, None
        if process is None or process.returncode is not None:
            process = await start(self.module, self.lock)
        send(process, order)
        return process

    async def close(self) -> None:
        """End the process that waits for an order."""
        process, self._ready = self._ready, None
        if process is not None:
            await end(process, 1.0)
