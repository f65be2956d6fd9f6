"""Call a function in a process apart, with limits of time and memory, without network and files.

What is posted may take time and memory without end. A library that reads files of strangers may
have a fault; shut in, it can neither send nor change what the service has. The process is a fork of
one that has loaded what it needs: it begins at once, and its memory is free again at its end.
"""

from __future__ import annotations

import copyreg
import ctypes
import errno
import multiprocessing
import os
import pickle
import resource
import signal
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

import psutil
from anyio import CapacityLimiter, fail_after, sleep, to_thread
from threadpoolctl import threadpool_limits

from solver.files import read_file
from studies.execution.forks import Forks
from studies.storage.room import FULL

READERS = Forks(("service.sandbox", "service.examined"))
"""The processes; what a call needs besides is loaded for it and all that follow. Xarray, which
checks and tables do not need, would take five times as long to load."""

_LIBC = ctypes.CDLL(None, use_errno=True)
_NO_NEW_PRIVILEGES = 38
"""Option of ``prctl``."""
_NEW_USERS, _NEW_NETWORK = 0x10000000, 0x40000000
"""Flags of ``unshare``: a network without a way out, which takes names of users of its own."""
_CREATE_RULESET, _ADD_RULE, _RESTRICT = 444, 445, 446
"""System calls of Landlock, the same on all processors."""
_WRITING = (0x1FF2, 0x3FF2, 0x7FF2)
"""Kinds of access that write, of its first three versions: write, remove, make, link, truncate."""

FAILED, CRASHED = errno.EPERM, errno.EFAULT
"""What is told of a function that raised an error, and of a library that ended the process."""


def memory(groups: Path = Path("/proc/self/cgroup"), mounted: Path = Path("/sys/fs/cgroup")) -> int:
    """Return the memory that this process and those it starts may have [bytes].

    The smallest limit of its control groups, of version 2 or 1, or all of the machine. In a
    container the path of a group may be that outside, and its files are at the top.
    """
    found = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    with suppress(OSError):
        for line in read_file(groups).decode().splitlines():
            _, kinds, path = line.split(":", 2)
            if kinds and "memory" not in kinds.split(","):
                continue
            top, name = (
                (mounted / "memory", "memory.limit_in_bytes") if kinds else (mounted, "memory.max")
            )
            own = top / path.lstrip("/")
            for folder in (own, *own.parents):
                with suppress(OSError, ValueError):  # no such file, or "max"
                    found.append(int(read_file(folder / name)))
    return min(found)


BYTES = min(max(memory() // 5, 2**30), 8 * 2**30)
"""Address space of a process [bytes]: the service, three of them and studies share the memory."""


class Ended(RuntimeError):
    """The process has ended without an answer."""


@dataclass
class Overdue(Exception):
    """The process has not ended in time; ``used`` is its processor time until then [s]."""

    used: float


@dataclass(frozen=True, slots=True)
class Answer:
    """What a call gave that was shut in.

    Attributes
    ----------
    text : the value of the function; empty if it has none
    failed : error number of the system if it was stopped: time, memory or room did not suffice; or
        `CRASHED`, or `FAILED`, see the log
    open : what this system does not let a process give up: ``network``, ``files``
    """

    text: str
    failed: int
    open: str


async def call(
    function: Callable[..., Any], *given: object, seconds: float, nice: int
) -> tuple[Any, Exception | None, float]:
    """Return what a function gives, or the error that it raises, and its processor time [s].

    All must be picklable. Raise `Overdue` after ``seconds``, `Ended` without an answer. A
    process with a larger niceness ``nice`` waits for others.
    """
    content, _ = await _called(_answer, function, (*given, nice), seconds)
    if not content:
        raise Ended
    found: tuple[Any, Exception | None, float] = pickle.loads(content)
    return found


async def call_shut_in(
    function: Callable[..., str],
    *given: object,
    folder: Path,
    cpu: float,
    seconds: float,
    nice: int,
) -> Answer:
    """Return what a function gives that has no network, and one folder to write in.

    It gives a text: whatever has taken the process over could send any object.

    Parameters
    ----------
    cpu : its processor time, in whole seconds
    seconds : its time; `Overdue` is raised after it
    nice : as of `call`
    """
    told = *given, folder, cpu, nice
    content, status = await _called(_answer_shut_in, function, told, seconds)
    left, _, text = content.decode(errors="replace").partition("\n")
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return Answer("", errno.ETIME, left)
    return Answer(text if not status else "", CRASHED if status < 0 else status, left)


async def _called(
    answer: Callable[..., None], function: Callable[..., Any], given: object, seconds: float
) -> tuple[bytes, int]:
    """Return what a process writes, and its exit status."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    module, one = getattr(function, "__module__", None) or "", CapacityLimiter(1)
    start = partial(READERS.start, answer, function, given, pipes=(theirs,), module=module)
    with theirs:
        try:
            fork = await to_thread.run_sync(start, limiter=one)
        except OSError as error:
            raise Overdue(0.0) if error.errno == errno.ETIMEDOUT else error from None
    try:
        with fail_after(seconds):
            content = await to_thread.run_sync(_all, ours, limiter=one, abandon_on_cancel=True)
            while (status := fork.returncode) is None:
                await sleep(0.001)
            return content, status
    except TimeoutError:
        raise Overdue(_processor_time(fork.pid)) from None
    finally:
        fork.kill()


def _processor_time(pid: int) -> float:
    """Return the processor time of a process [s]; 0 if it has just ended."""
    with suppress(psutil.Error):
        used = psutil.Process(pid).cpu_times()
        return float(used.user + used.system)
    return 0.0


def _all(pipe: Connection) -> bytes:
    """Return all that comes through a pipe."""
    with pipe:
        return b"".join(iter(lambda: os.read(pipe.fileno(), 1 << 20), b""))


def _limit(into: Connection, nice: int) -> None:
    """Limit memory and urgency of this process, and keep it from all but a pipe and the log."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the service's to handle
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nothing, stream)
    kept = sorted({2, into.fileno()})
    for number, following in pairwise([*kept, os.sysconf("SC_OPEN_MAX")]):
        os.closerange(number + 1, following)
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    os.nice(nice)
    threadpool_limits(1)


def _answer(into: Connection, function: Callable[..., Any], given: tuple[Any, ...]) -> None:
    """Write a pickle of what a function returns, the error that it raises, and its time [s].

    An error is pickled by its own rule. That of `tblib`, which Dask sets for all errors, adds what
    the error came from; in the errors of pydantic that has no end.
    """
    *own, nice = given
    _limit(into, nice)
    found, failed = None, None
    try:
        found = function(*own)
    except Exception as error:
        failed = error
    out = BytesIO()
    pickler = pickle.Pickler(out)
    pickler.dispatch_table = {
        kind: rule
        for kind, rule in copyreg.dispatch_table.items()
        if not issubclass(kind, BaseException)
    }
    pickler.dump((found, failed, _used()))
    _write(into, out.getbuffer())


def _answer_shut_in(
    into: Connection, function: Callable[..., str], given: tuple[Any, ...]
) -> NoReturn:
    """Write what this system does not let this process give up, and the answer of a function."""
    status = FAILED
    *own, folder, seconds, nice = given
    try:
        _limit(into, nice)
        most = max(int(seconds), 1)
        resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
        tempfile.tempdir = str(folder)
        _write(into, f"{_shut_in(folder)}\n".encode())
        _write(into, function(*own).encode())
        status = 0
    except MemoryError:
        status = errno.ENOMEM
    except OSError as error:
        status = errno.ENOSPC if error.errno in FULL else status
        traceback.print_exc()
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)


def _write(into: Connection, content: bytes | memoryview) -> None:
    """Write all of a content."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(into.fileno(), rest) :]


def _shut_in(folder: Path) -> str:
    """Give up the network, and all files but those in a folder; return what remains open."""
    if sys.platform != "linux":
        return "network files"
    left = [] if _LIBC.unshare(_NEW_USERS | _NEW_NETWORK) == 0 else ["network"]
    version = _LIBC.syscall(_CREATE_RULESET, None, 0, 1)
    if version < 1:
        return " ".join([*left, "files"])
    writing = _WRITING[min(version, len(_WRITING)) - 1]
    rules = _LIBC.syscall(_CREATE_RULESET, struct.pack("Q", writing), 8, 0)
    beneath = struct.pack("=Qi", writing, os.open(folder, os.O_PATH))
    done = (
        _LIBC.syscall(_ADD_RULE, rules, 1, beneath, 0),
        _LIBC.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0),
        _LIBC.syscall(_RESTRICT, rules, 0),
    )
    return " ".join(left if not any(done) else [*left, "files"])


def _used() -> float:
    """Return the processor time of this process and of those that it has waited for [s]."""
    each = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return sum(used.ru_utime + used.ru_stime for used in each)
