"""The command ``residua`` with the fake scene, for tests that need a process of its own."""

from __future__ import annotations

import sys

import tests.studies.fakes  # noqa: F401
from residua.cli import main

if __name__ == "__main__":
    sys.exit(main())
