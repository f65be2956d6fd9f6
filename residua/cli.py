"""The command ``residua``: from its arguments to its exit status."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from residua.neighbours import stranger
from residua.status import BAD_INPUT, FAILED, INTERRUPTED, OK, complain


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    0: all went well. 1: not all runs are ok: some failed, or something kept them from being
    computed, such as another process in the directory. 2: bad input, or other packages than those
    of this command. 130: interrupted.
    """
    if reason := stranger():
        return complain(reason, BAD_INPUT)
    from residua.arguments import parser  # imports the neighbours, which are known now
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
        return options.command(options)
    except (ModelError, StudyError) as error:
        return complain(error, BAD_INPUT)
    except (CatalogueDamaged, FileDiffers, GridLost, StoreBusy, StoreFull) as error:
        return complain(error, FAILED)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has left; say no more
        return OK
    except OSError as error:
        return complain(error, FAILED)
