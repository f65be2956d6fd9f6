"""The command ``residua``: from its arguments to its exit status."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from residua.neighbours import wrong_package
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
