"""The command ``residua``: from its arguments to its exit status.

The names of the packages that it imports are common words. Another package of the same name, or a
folder in the directory where Python was started, may be found first; an import then fails with an
error that is hard to understand.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from residua.status import BAD_INPUT, FAILED, INTERRUPTED, OK, complain

_YOUNG = 50_000
"""Number of new objects after which Python looks for garbage. Modules make many objects and no
garbage: with Python's own 700 the search takes a seventh of the time to load them."""

# A search for garbage at the end, among all that libraries have loaded, takes 0.3 s.
atexit.register(gc.freeze)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    0: success. 1: not all runs are ok: some failed, or could not be computed, for instance because
    another process computes in the directory. 2: bad input, or Python finds other packages of the
    same names. 130: interrupted.
    """
    try:
        return _run(arguments)
    except KeyboardInterrupt:  # also while libraries are loaded
        return INTERRUPTED


def _run(arguments: Sequence[str] | None) -> int:
    if reason := wrong_package():
        return complain(reason, BAD_INPUT)
    gc.set_threshold(_YOUNG)
    # BLAS reads it when it is loaded. Workers compute; and only a process of one thread is forked.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from residua.arguments import parser  # imports the other packages, which are checked now
    from solver.errors import ModelError
    from solver.parts import load_own_parts
    from studies.errors import (
        CatalogueDamaged,
        FileDiffers,
        GridLost,
        StoreBusy,
        StoreFull,
        StudyError,
    )

    options = parser().parse_args(arguments)
    try:
        load_own_parts()
        if study := getattr(options, "study", None) if hasattr(options, "path") else None:
            if isinstance(options.path, str):
                raise StudyError("--study", study, "must be left out: a URL is that of one study")
            options.path = options.path / study
        return options.command(options)
    except (ModelError, StudyError) as error:
        return complain(error, BAD_INPUT)
    except (CatalogueDamaged, FileDiffers, GridLost, StoreBusy, StoreFull) as error:
        return complain(error, FAILED)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output has closed it: print nothing more
        return OK
    except OSError as error:
        return complain(error, FAILED)


NEIGHBOURS = ("solver", "studies", "service")
"""The packages that must be in the same folder as this one."""


def wrong_package() -> str:
    """Return one line about the first package that Python finds elsewhere; empty if none.

    No package is imported for this check.
    """
    home = Path(__file__).parents[1]
    for name in NEIGHBOURS:
        found, own = _place(name), home / name
        if found is None:
            return f"Python finds no package {name!r}; this command needs the one at {own}"
        if found.resolve() != own.resolve():
            return (
                f"Python finds the package {name!r} at {found}; this command needs the one at "
                f"{own}: rename the other one, or take its folder off Python's path"
            )
    return ""


def _place(name: str) -> Path | None:
    """Return the folder of a package, or the file of a module; None if Python finds neither."""
    spec = find_spec(name)
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    return Path(folders[0] if folders else str(spec.origin))
