"""Call a function in a copy of this process that has no network and one folder to write in.

A library that reads files of strangers may have a fault; it can then neither send nor change what
the service has. A copy of a process that has loaded what it needs begins at once, and its memory is
free again when it ends.
"""

from __future__ import annotations

import ctypes
import errno
import os
import resource
import signal
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from studies.execution.forking import close_files
from studies.storage.room import FULL

_LIBC = ctypes.CDLL(None, use_errno=True)
_DEATH_SIGNAL, _NO_NEW_PRIVILEGES = 1, 38
"""Options of ``prctl``."""
_NEW_USERS, _NEW_NETWORK = 0x10000000, 0x40000000
"""Flags of ``unshare``: a network without a way out, which takes names of users of its own."""
_CREATE_RULESET, _ADD_RULE, _RESTRICT = 444, 445, 446
"""System calls of Landlock, the same on all processors."""
_WRITING = (0x1FF2, 0x3FF2, 0x7FF2)
"""Kinds of access that write, of its first three versions: write, remove, make, link, truncate."""

FAILED, CRASHED = errno.EPERM, errno.EFAULT
"""What is told of a function that raised an error, and of a library that ended the process."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a call gave.

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


def alone(function: Callable[..., str], *given: object, folder: Path, seconds: float) -> Answer:
    """Return what a function gives in a copy of this process.

    It gives a text: whatever has taken the copy over could send any object.

    Parameters
    ----------
    folder : where it may write
    seconds : its processor time, in whole seconds
    """
    out, into = os.pipe()
    process = os.fork()
    if not process:
        _answer(into, function, given, folder, seconds)
    os.close(into)
    with os.fdopen(out, encoding="utf-8", errors="replace") as pipe:
        left, _, text = pipe.read().partition("\n")
    _, status = os.waitpid(process, 0)
    failed = os.waitstatus_to_exitcode(status)
    if failed in (-signal.SIGXCPU, -signal.SIGKILL):
        failed = errno.ETIME
    elif failed < 0:
        failed = CRASHED
    return Answer(text, failed, left)


def _answer(
    into: int, function: Callable[..., str], given: tuple[object, ...], folder: Path, seconds: float
) -> NoReturn:
    """Write the answer of the function, and end."""
    status = FAILED
    try:
        _let_go(into)
        most = max(int(seconds), 1)
        resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
        tempfile.tempdir = str(folder)
        with os.fdopen(into, "w", encoding="utf-8") as pipe:
            pipe.write(f"{_shut_in(folder)}\n")
            pipe.write(function(*given))
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


def _let_go(into: int) -> None:
    """Close all files but a pipe and the log: the standard output speaks to the service."""
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    close_files(but=[into])


def _shut_in(folder: Path) -> str:
    """Give up the network, and all files but those in a folder; return what remains open.

    The process ends with the one that started it.
    """
    if sys.platform != "linux":
        return "network files"
    _LIBC.prctl(_DEATH_SIGNAL, signal.SIGKILL)
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
