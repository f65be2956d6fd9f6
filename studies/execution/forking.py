"""A process that has loaded what a worker needs; each worker is a fork of it.

To load solver and libraries takes longer than a small study. The process (Python's fork server)
has one thread and computes nothing. It starts with the first workers, and ends with this process.
It is a fork of this process where that is one of ours which has a single thread.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import multiprocessing
import os
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from itertools import pairwise
from multiprocessing import forkserver, util
from pathlib import Path
from typing import Any

from solver.parts import own_files
from studies.scratch import scratch

NEEDED = (
    "distributed.nanny",
    "netCDF4",
    "h5py",
    "solver.contact.given_bound",
    "solver.linear.pardiso",
    "solver.results.solution",
    "solver.scenes.punch_setup",
    "studies.execution.grid",
    "studies.execution.task",
    "studies.execution.loaded",
)
"""Modules that are loaded before a worker is forked; with them all that they import."""

FORK_SERVER = "_RESIDUA_FORK_SERVER"
"""Environment variable that tells `studies.execution.loaded` that forks follow."""

FORK_HERE = "_RESIDUA_FORK_HERE"
"""Environment variable that a process of ours sets to be forked itself, if it has one thread.

A script of a user is never forked: workers would have its files and count its memory as theirs."""

_ALLOCATION = {"MALLOC_TRIM_THRESHOLD_": -1, "MALLOC_MMAP_THRESHOLD_": -3}
"""Settings that C's library reads when a process starts, with their numbers in ``mallopt``."""


_FOLDER = ExitStack()
"""The folder of sockets, until this process ends."""
atexit.register(_FOLDER.close)


def prepare(settings: Mapping[str, object], more: Sequence[str] = ()) -> str:
    """Start to load the modules, and return the method of `multiprocessing` for the workers.

    It is ``spawn`` where a process that has loaded libraries cannot be forked safely, where the
    user's own files add parts (a worker must load these itself), and where the name of the folder
    for temporary files is too long for a socket.

    Parameters
    ----------
    settings : environment variables that libraries read when they are loaded
    more : modules to load before these
    """
    if sys.platform != "linux" or own_files():
        return "spawn"
    process: Any = multiprocessing.current_process()
    if not process._config.get("tempdir"):  # else its folder would stay after a kill
        process._config["tempdir"] = str(_FOLDER.enter_context(scratch()))
    preloaded = [*more, *NEEDED]
    multiprocessing.get_context("forkserver").set_forkserver_preload(preloaded)
    # The modules are found where this process finds them, before anything in its directory.
    found = {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "PYTHONSAFEPATH": "1",
        FORK_SERVER: "1",
    }
    patched: Any = util
    begin = patched.spawnv_passfds

    def begun(path: Any, arguments: Sequence[Any], passed: Sequence[int]) -> int:
        """Start the process as `multiprocessing` does, or as a fork; return its id."""
        *options, code = arguments
        if FORK_HERE in os.environ and _threads() == 1:
            for module in preloaded[:-1]:
                import_module(module)
            if _threads() == 1:
                return _fork(code, passed, settings)
        # It reads no settings of libraries where this process was started.
        return begin(path, [*options, f"import os; os.chdir('/'); {code}"], passed)

    with variables({**settings, **found}):
        patched.spawnv_passfds = begun
        try:
            forkserver.ensure_running()
        except OSError as error:
            if "too long" not in str(error):  # the name of a socket has at most 107 bytes
                raise
            return "spawn"
        finally:
            patched.spawnv_passfds = begin
    return "forkserver"


def _threads() -> int:
    """Return the number of threads of this process, with those of libraries."""
    return len(list(Path("/proc/self/task").iterdir()))


def _fork(code: str, passed: Sequence[int], settings: Mapping[str, object]) -> int:
    """Execute code in a fork of this process, with some of its files; return the id."""
    sys.stdout.flush()
    sys.stderr.flush()
    process = os.fork()
    if process:
        return process
    try:
        gc.freeze()  # or an object of this process could close a file of the fork
        close_files(but=passed)
        os.chdir("/")
        libc = ctypes.CDLL(None)
        for name in _ALLOCATION.keys() & settings.keys():
            libc.mallopt(_ALLOCATION[name], int(str(settings[name])))
        # Its lock is held here, and its files are closed.
        forkserver._forkserver.__init__()  # type: ignore[misc]
        exec(code, {})
    except Exception:
        traceback.print_exc()
    finally:
        os._exit(0)


def close_files(but: Iterable[int]) -> None:
    """Close the files of this process, except for the standard ones and the given."""
    kept = sorted({2, *but})
    for number, following in pairwise([*kept, os.sysconf("SC_OPEN_MAX")]):
        os.closerange(number + 1, following)


@contextmanager
def variables(changes: Mapping[str, object]) -> Iterator[None]:
    """Set environment variables for the processes that are started meanwhile.

    Other variables are left alone, because other threads may read them.
    """
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update({name: str(value) for name, value in changes.items()})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
