"""Provenance of a file: the problem, the sources, and the software that computed it."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import subprocess
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import solver
from solver.errors import ModelError
from solver.scenes import Scene
from studies.definition.identity import solver_hash
from studies.scenes.registry import attributes

NONE = "none"
"""Value for a library that is not installed, and for a linear solver that is not available."""

_LIBRARIES = ("numba", "mkl", "numpy", "scipy", "scikit-fem", "xarray")


def provenance(title: str, scene: Scene, parameters: Mapping[str, Any]) -> dict[str, str]:
    """Return the global attributes of a file: title, inputs, software and time.

    The software is in two of them: ``versions``, a JSON object of the versions of solver and
    libraries, and ``linear_solver``, which is ``pardiso`` or ``superlu``.
    """
    return {
        "Conventions": "CF-1.11",
        "title": title,
        **attributes(scene),
        "parameters": json.dumps(parameters),
        "source": f"Residua {solver.__version__}",
        "solver_source": solver_hash(),
        "versions": json.dumps(_versions()),
        "linear_solver": _linear_solver(),
        **_commit(),
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def what_ran(attributes: Mapping[str, str]) -> tuple[str, str]:
    """Return the attributes of a file on the software that computed it."""
    return attributes["versions"], attributes["linear_solver"]


def together(ran: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the attributes on the software of several runs, each as `what_ran` returns it.

    Runs of one study may come from different machines and times: different values are listed, with
    commas. Without runs the result is empty.
    """
    known = sorted(set(ran))
    if not known:
        return {}
    versions = [json.loads(text) for text, _ in known]
    names = dict.fromkeys(name for each in versions for name in each)
    merged = {name: _listed(each.get(name, NONE) for each in versions) for name in names}
    return {"versions": json.dumps(merged), "linear_solver": _listed(each for _, each in known)}


def _listed(texts: Iterable[str]) -> str:
    return ", ".join(sorted(set(texts)))


@cache
def _versions() -> dict[str, str]:
    """Return versions from the metadata of packages: importing numba would take a second."""
    found = {"solver": solver.__version__}
    for name in _LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = NONE
    return found


def _linear_solver() -> str:
    """Return the linear solver that this process uses."""
    from solver.linear.solvers import chosen  # imports scipy, needed only to write a file

    try:
        return chosen()
    except ModelError:
        return NONE


@cache
def _commit() -> dict[str, str]:
    """Return the commit of the solver's working tree; empty if it is not under git."""
    root = Path(solver.__file__).parent
    git = ["git", "-C", str(root)]
    try:
        for command in (
            [*git, "ls-files", "--error-unmatch", "__init__.py"],
            [*git, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
        ):
            answer = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return {}
    return {"commit": answer.stdout.strip()}
