"""Order of the test files of a run, and which of them one test process runs.

The files of the service go to one process, one after another: they share services, and while they
wait, other processes compute.
"""

from __future__ import annotations

from functools import cache
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
            "verification/test_steady_laws.py",
            "test_examples.py",
            "stability/test_scenes.py",
            "verification/test_derivatives.py",
            "verification/test_mutations.py",
            "verification/test_rolling_table.py",
            "verification/test_rolling_endless.py",
            "verification/test_punch.py",
            "solver/test_shot.py",
            "studies/test_goal.py",
            "benchmarks/test_benchmarks.py",
            "verification/test_rolling.py",
            "studies/test_fit.py",
            "verification/test_ball.py",
            "verification/test_large_bodies.py",
            "studies/test_derivatives.py",
            "service/test_durability.py",
            "verification/test_contact_in_time.py",
            "studies/plots/test_many.py",
            "verification/test_coarser.py",
            "verification/test_rolling_elastic.py",
            "verification/test_fretting.py",
            "verification/test_wheel_rail.py",
            "verification/test_prism_passes.py",
            "studies/test_grid.py",
            "studies/test_names.py",
            "studies/test_crate.py",
            "studies/scenes/test_mistakes.py",
            "studies/test_kill.py",
            "studies/test_wear.py",
            "studies/test_minimise.py",
            "studies/plots/test_maps.py",
            "studies/test_scheduler.py",
            "studies/test_fatigue.py",
            "studies/test_traffic.py",
            "studies/test_refine.py",
            "studies/test_own_parts.py",
            "studies/test_combine.py",
            "studies/test_predict.py",
            "studies/test_run.py",
            "studies/test_part.py",
        )
    ),
)
"""Units that take long, in the order in which they start: no core waits for them at the end. One
that starts processes and waits for them comes after some that compute: `TOGETHER` waits too, and
when it is about to end others take turns with those that compute."""


class Order(LoadFileScheduling):
    """Hands out files whole, and those of `TOGETHER` as one."""

    def _split_scope(self, nodeid: str) -> str:
        return str(unit(HERE.parent / super()._split_scope(nodeid)))


def unit(file: Path) -> Path:
    """Return what is handed to a test process at once: a file, or the folder of `TOGETHER`."""
    return TOGETHER if TOGETHER in file.parents and file not in FIRST else file


def turned(share: float) -> list[Path]:
    """Return all folders and files with tests, from those on that stand behind a share of them."""
    found = sorted(each for each in HERE.iterdir() if each.is_dir() or each.match("test_*.py"))
    found = [each for each in found if each.is_file() or any(each.rglob("test_*.py"))]
    first = round(share * len(found))
    return found[first:] + found[:first]


@cache
def place(file: Path) -> int:
    """Return by what the files of the test run are sorted."""
    return FIRST.index(unit(file)) if unit(file) in FIRST else len(FIRST)
