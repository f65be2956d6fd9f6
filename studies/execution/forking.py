"""A process that has loaded what a worker needs; each worker is a fork of it.

To load solver and libraries takes longer than a small study. The process (Python's fork server)
has one thread and computes nothing. It starts with the first workers, and ends with this process.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Mapping

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
)
"""Modules that are loaded before a worker is forked; with them all that they import."""


def prepare(settings: Mapping[str, object]) -> str:
    """Start to load the modules, and return the method of `multiprocessing` for the workers.

    It is ``spawn`` where a process that has loaded libraries cannot be forked safely, and where the
    user's own files add parts: a worker must load these itself.

    Parameters
    ----------
    settings : environment variables that libraries read when they are loaded
    """
    if sys.platform != "linux" or own_files():
        return "spawn"
    from multiprocessing.forkserver import ensure_running

    multiprocessing.get_context("forkserver").set_forkserver_preload(list(NEEDED))
    # The modules are found where this process finds them, before anything in its directory.
    found = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "PYTHONSAFEPATH": "1"}
    before = os.environ.copy()
    os.environ.update({**_texts(settings), **before, **found})
    try:
        ensure_running()
    finally:
        os.environ.clear()
        os.environ.update(before)
    return "forkserver"


def beginning(settings: Mapping[str, object]) -> str:
    """Return what a worker runs first: it takes its environment from this process."""
    environment = {**_texts(settings), **os.environ}
    return f"import os\nos.environ.clear()\nos.environ.update({environment!r})\n"


def _texts(settings: Mapping[str, object]) -> dict[str, str]:
    return {name: str(value) for name, value in settings.items()}
