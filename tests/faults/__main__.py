"""``python -m tests.faults [NAME ...]``: whether the test of each fault, or of some, catches it."""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

from tests.faults import caught, copied, fails, faults

MEMORY, SECONDS = 8 * 2**30, 600
"""Limits of the tests: a fault may let them take all memory, or never end."""


def main() -> int:
    """Run the command; return the number of faults that are not caught."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="faults, or their beginnings")
    parser.add_argument("--tests", nargs="+", help="run these instead of the one of each fault")
    parser.add_argument("--table", action="store_true", help="print the rows of its page")
    given = parser.parse_args()
    chosen = [f for f in faults() if not given.names or f.name.startswith(tuple(given.names))]
    missed = 0
    if given.table:
        print(*(fault.row for fault in chosen), sep="\n")
        return missed
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copied(folder)
        if fails(folder, given.tests or sorted({fault.test for fault in chosen})):
            sys.exit("the tests fail without a fault")
        for fault in chosen:
            found = caught(folder, fault, given.tests or [fault.test])
            missed += not found
            print("caught    " if found else "NOT caught", fault.name, flush=True)
    return missed


if __name__ == "__main__":
    sys.exit(main())
