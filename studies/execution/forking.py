"""A process that has loaded what a worker needs; each worker is a fork of it.

To load solver and libraries takes longer than a small study. The process (Python's fork server)
has one thread and computes nothing. It starts with the first workers, and ends with this process.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from solver.parts import own_files

NEEDED = (
    "distributed.nanny",
    "netCDF4",
    "h5py",
    "solver.contact.lemke",
    "solver.linear.pardiso",
    "solver.results.solution",
    "solver.scenes.punch",
    "studies.execution.grid",
    "studies.execution.task",
    "studies.execution.loaded",
)
"""Modules that are loaded before a worker is forked; with them all that they import."""


FORK_SERVER = "_RESIDUA_FORK_SERVER"
"""Environment variable that tells `studies.execution.loaded` that forks follow."""


def prepare(settings: Mapping[str, object]) -> str:
    """Start to load the modules, and return the method of `multiprocessing` for the workers.

    It is ``spawn`` where a process that has loaded libraries cannot be forked safely, where the
    user's own files add parts (a worker must load these itself), and where the name of the folder
    for temporary files is too long for a socket.

    Parameters
    ----------
    settings : environment variables that libraries read when they are loaded
    """
    if sys.platform != "linux" or own_files():
        return "spawn"
    from multiprocessing.forkserver import ensure_running

    multiprocessing.get_context("forkserver").set_forkserver_preload(list(NEEDED))
    # The modules are found where this process finds them, before anything in its directory.
    found = {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "PYTHONSAFEPATH": "1",
        FORK_SERVER: "1",
    }
    with variables({**settings, **found}):
        try:
            ensure_running()
        except OSError as error:
            if "too long" not in str(error):  # the name of a socket has at most 107 bytes
                raise
            return "spawn"
    return "forkserver"


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
