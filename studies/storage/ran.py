"""How a run was computed: when, on which machine, with how much memory and which libraries.

These are attributes of the file of a run, and variables of a data set. They are no part of an id:
a run is the same wherever it is computed.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import solver
from solver.files import read_file
from solver.memory import peak_memory
from studies.storage.dataset import Variable
from studies.storage.provenance import NONE
from studies.storage.seal import digest_of

LOCK = "requirements.lock"
"""File beside the packages with the digest of every library that an installation may have."""

MEANINGS = {
    "run_started": "time at which the computation of the run began, UTC",
    "run_ended": "time at which the computation of the run ended, UTC",
    "run_machine": "machine that computed the run, a key of the attribute `machines`",
    "run_peak_memory": "largest memory of the process that computed the run, until its end",
}
"""Names and meanings of what is known of the computation of a run, all of them texts: they are no
numbers of the run."""
MACHINES = "machines"
"""Attribute of a data set with the machines of its runs, which the file of a run has in full."""


def now() -> str:
    """Return the time, UTC."""
    time = datetime.datetime.now(datetime.UTC).replace(tzinfo=None)
    return f"{time.isoformat(timespec='milliseconds')}Z"


def how(began: str) -> dict[str, str]:
    """Return the attributes of a run that this process has just computed.

    Parameters
    ----------
    began : time at which it began; empty if it is not known, as of a process that has died
    """
    if not began:
        return {}
    memory = f"{peak_memory() / 1e6:.0f}MB"
    return dict(zip(MEANINGS, (began, now(), _machine(), memory), strict=True))


def of_runs(
    dims: Sequence[str], shape: Sequence[int], runs: Mapping[int, Mapping[str, Any]]
) -> tuple[dict[str, Variable], dict[str, str]]:
    """Return the variables and attributes of a data set on the computation of its runs.

    Parameters
    ----------
    dims, shape : the dimensions of the sweep
    runs : attributes of the files of runs by their number, the last dimension fastest; one of an
        earlier version has none of these
    """
    known = sorted({each["run_machine"] for each in runs.values() if "run_machine" in each})
    keys = {machine: str(k) for k, machine in enumerate(known, start=1)}
    found = {}
    for name, words in MEANINGS.items():
        values = np.full(shape, "", dtype=object)
        for k, attributes in runs.items():
            value = attributes.get(name, "")
            values.flat[k] = keys.get(value, value)
        found[name] = Variable(tuple(dims), values, {"long_name": words})
    machines = {key: json.loads(machine) for machine, key in keys.items()}
    return found, {MACHINES: json.dumps(machines)}


@cache
def lock() -> str:
    """Return the digest of the lock of this installation; none if it has no lock."""
    try:
        return digest_of(read_file(Path(solver.__file__).parents[1] / LOCK))
    except OSError:
        return NONE


@cache
def _machine() -> str:
    """Return processor, system, lock and libraries of linear algebra of this process as JSON.

    It is asked for after a run, so that the libraries are those that the run has loaded.
    """
    from threadpoolctl import threadpool_info  # not needed by those who read files

    from solver.linear.solvers import one_thread

    with one_thread():  # as in the increments of a run
        loaded = threadpool_info()
    blas = [
        {
            "library": each["internal_api"],
            "version": each["version"],
            "kernel": each.get("architecture") or NONE,
            "threads": each["num_threads"],
        }
        for each in loaded
        if each["user_api"] == "blas"
    ]
    blas.sort(key=json.dumps)  # whichever was loaded first
    return json.dumps(
        {
            "processor": _processor(),
            "system": f"{platform.system()} {platform.machine()}",
            "python": platform.python_version(),
            "cores": os.cpu_count(),
            "lock": lock(),
            "blas": blas,
        }
    )


def _processor() -> str:
    """Return the model of the processor, as Linux names it, or else as Python does."""
    try:
        lines = read_file("/proc/cpuinfo").decode(errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or platform.machine()
