"""The command: compute in both checkouts, compare, and print a table in Markdown."""

from __future__ import annotations

import argparse
import os
import pickle
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import tests.compare
from tests.compare import worker
from tests.compare.changes import Row, compared, geometric_mean
from tests.compare.runs import runs
from tests.stability.families import EVERY, FAMILIES

Job = tuple[str, tuple[Any, ...]]

FEW = {"rolling-fine": 1, "rolling-convergence": 2, "rolling-table": 2, "rolling-coarse": 3}
"""Largest number of runs of studies whose runs take a minute each."""
PATIENCE = 20.0
"""Seconds of CPU after which a scene is left out."""
SHOWN = 8
"""Number of changes that are listed for each row."""


class Pair(NamedTuple):
    """The comparison of one study or family, and what it cost in the pairs: (old, new)."""

    name: str
    row: Row
    seconds: list[tuple[float, float]]
    memory: tuple[int, int]

    @property
    def ratio(self) -> float:
        """Processor time of the new code over that of the old."""
        return geometric_mean(new / old for old, new in self.seconds)

    def __str__(self) -> str:
        row, (before, after) = self.row, self.memory
        return (
            f"| {self.name} | {row.runs} | {row.left_out} | {row.values} | {row.worst[0]:.1e} "
            f"| {row.worst[1]} | {len(row.moved)} | {len(row.statuses)} | {len(row.alone)} "
            f"| {self.seconds[0][0]:.1f} | {self.ratio:.3f} | {after / before:.3f} |"
        )


COLUMNS = (
    "compared", "records", "left out", "values", "largest change / level", "of", "above the limit",
    "statuses differ", "only one side", "CPU old [s]", "CPU new / old", "memory new / old",
)  # fmt: skip


def jobs(studies: Path, most: int, scenes: int) -> dict[str, Job]:
    """Return what is computed, by name: studies, families of scenes, runs."""
    found: dict[str, Job] = {}
    for file in sorted(studies.glob("*.toml")):
        found[f"study {file.stem}"] = ("study", (str(file), FEW.get(file.stem, most)))
    # a scene of each family in turn, until there are enough
    turns = {f: [n for n in EVERY if n.rpartition("-")[0] == f] for f in FAMILIES}
    for own in turns.values():
        random.Random(0).shuffle(own)
    ranked = sorted((k, n) for own in turns.values() for k, n in enumerate(own))[:scenes]
    for family, own in turns.items():
        kept = [name for k, name in ranked if name in own]
        found[f"family {family}"] = ("family", (kept, PATIENCE))
    for name, (scene, given) in runs().items():
        _, (own_runs,) = found.setdefault(f"runs {Path(scene).stem}", ("runs", ({},)))
        own_runs[name] = (scene, given)
    return found


def computed(root: Path, job: Job) -> worker.Computed:
    """Compute a job with the interpreter and the code of a checkout."""
    text = Path(worker.__file__).read_text(encoding="utf-8")
    own = {n: v for n, v in os.environ.items() if not n.startswith(("PYTHON", "RESIDUA_", "VIRT"))}
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with tempfile.NamedTemporaryFile() as out:
        run = subprocess.run(
            [root / ".venv/bin/python", "-W", "ignore", "-c", text, out.name],
            cwd=root, env=own | one, input=pickle.dumps(job), capture_output=True, check=False,
        )  # fmt: skip
        if run.returncode:
            raise RuntimeError(f"{root}: {run.stderr.decode()[-2000:]}")
        found: worker.Computed = pickle.loads(Path(out.name).read_bytes())
    return found


def pair(roots: tuple[Path, Path], pairs: int, named: tuple[str, Job]) -> Pair | str:
    """Compute a job in both checkouts, so many times in turn; return why where it fails."""
    name, job = named
    try:
        both = [[computed(root, job) for root in roots] for _ in range(pairs)]
    except RuntimeError as error:
        return f"{name}: {error}"
    seconds = [(old[0], new[0]) for old, new in both]
    # what a process takes from the system scatters by a fifth: the least of all pairs counts
    memory = (min(old[1] for old, _ in both), min(new[1] for _, new in both))
    return Pair(name, compared(both[0][0][2], both[0][1][2]), seconds, memory)


def listed(row: Row) -> Iterator[str]:
    """Yield what is not the same, line by line."""
    yield from (f"  {change:.1e} {where}" for change, where in row.moved[:SHOWN])
    yield from (f"  {name}: {old} -> {new}" for name, old, new in row.statuses[:SHOWN])
    yield from (f"  {what}" for what in row.alone[:SHOWN])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.compare",
        description=tests.compare.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("old", type=Path, metavar="OLD")
    parser.add_argument("new", type=Path, metavar="NEW")
    parser.add_argument("--only", default="", help="names of rows, or of their kinds: punch,runs")
    parser.add_argument("--runs", type=int, default=6, help="largest number of runs of a study")
    parser.add_argument("--scenes", type=int, default=200, help="number of seeded scenes")
    parser.add_argument("--pairs", type=int, default=1, help="times that each row is computed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    given = parser.parse_args(arguments)
    roots = (given.old.resolve(), given.new.resolve())
    asked = set(filter(None, given.only.split(",")))
    every = jobs(roots[0] / "data/studies", given.runs, given.scenes)
    chosen = [(name, job) for name, job in every.items() if not asked or asked & {*name.split()}]
    if lost := asked - {word for name in every for word in name.split()}:
        parser.error(f"no row {', '.join(sorted(lost))}; rows: {', '.join(every)}")
    failed, kept = [], []
    print(f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|", sep="\n", flush=True)
    with ThreadPoolExecutor(given.jobs) as pool:
        for end in pool.map(partial(pair, roots, given.pairs), chosen):
            if isinstance(end, str):
                failed.append(end)
            else:
                kept.append(end)
                print(end, flush=True)
    print()
    for each in kept:
        if not each.row.same:
            print(f"{each.name}:", *listed(each.row), sep="\n")
    print(*failed, sep="\n")
    if ratios := [(each.ratio, each.name) for each in kept if each.name.startswith("study ")]:
        mean, (worst, name) = geometric_mean(ratio for ratio, _ in ratios), max(ratios)
        print(f"CPU new / old of studies: geometric mean {mean:.3f}, largest {worst:.3f} ({name})")
    same = not failed and all(each.row.same for each in kept)
    print("the same" if same else "NOT the same")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
