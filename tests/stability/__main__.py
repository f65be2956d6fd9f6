"""``python -m tests.stability [NAME ...]``: all seeded scenes, or some of them.

One thread in each process, decided before any numerical library is loaded.
"""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run the command."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    from tests.stability.command import run

    return run()


if __name__ == "__main__":
    sys.exit(main())
