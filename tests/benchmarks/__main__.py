"""``python -m tests.benchmarks``; one thread, decided before any numerical library is loaded."""

from __future__ import annotations

import os


def main() -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    from tests.benchmarks.command import run

    run()


if __name__ == "__main__":
    main()
