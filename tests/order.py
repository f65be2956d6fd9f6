"""Order of the test files of a run, and which of them one test process runs.

The files of the service go to one process, one after another: they share services, and while they
wait, other processes compute.
"""

from __future__ import annotations

from pathlib import Path

from xdist.scheduler import LoadFileScheduling

from tests.marks import HERE

TOGETHER = HERE / "service"
"""A folder whose files share processes, except those that are in `FIRST` by themselves."""

FIRST = (
    TOGETHER,
    *(
        HERE / name
        for name in (
            "test_docs.py",
            "verification/test_mutations.py",
            "verification/test_coarser.py",
            "verification/test_track_ends.py",
            "verification/test_steady_laws.py",
            "verification/test_rolling_endless.py",
            "verification/test_rolling_table.py",
            "verification/test_rolling.py",
            "verification/test_rolling_elastic.py",
            "verification/test_punch.py",
            "verification/test_ball.py",
            "verification/test_contact_in_time.py",
            "verification/test_shakedown.py",
            "test_examples.py",
            "benchmarks/test_benchmarks.py",
            "stability/test_scenes.py",
            "service/test_durability.py",
            "service/test_together.py",
            "studies/test_kill.py",
            "studies/test_own_parts.py",
            "studies/test_run.py",
        )
    ),
)
"""Files that take long, in the order in which they start: no core waits for them at the end.
Those that wait a lot come last, when the folder above has ended."""


class Order(LoadFileScheduling):
    """Hands out files whole, and those of `TOGETHER` as one."""

    def _split_scope(self, nodeid: str) -> str:
        return str(unit(HERE.parent / super()._split_scope(nodeid)))


def unit(file: Path) -> Path:
    """Return what is handed to a test process at once: a file, or the folder of `TOGETHER`."""
    return TOGETHER if TOGETHER in file.parents and file not in FIRST else file


def place(file: Path) -> int:
    """Return by what the files of the test run are sorted."""
    return FIRST.index(unit(file)) if unit(file) in FIRST else len(FIRST)
