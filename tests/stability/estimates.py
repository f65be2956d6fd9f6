"""``python -m tests.stability.estimates``: how many own scenes take as long as was estimated.

The scene files of the family ``files``, as drawn and with finer meshes, computed as studies of one
run, without any past run. The processor time of each should be in the range of its estimate.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from studies import Store, Study, estimate
from studies.execution.task import compute_here
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.stability.kinds.files import draw

SEED = 1954


class Timed(NamedTuple):
    """Processor time of a scene: as estimated, low, likely and high, and as it was [s]."""

    what: str
    low: float
    likely: float
    high: float
    took: float

    @property
    def inside(self) -> bool:
        """Whether it was as estimated."""
        return self.low <= self.took <= self.high


def drawn(count: int, finer: float = 1.0) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield scenes, with elements that are smaller by a factor."""
    rng = np.random.default_rng(SEED)
    for number in range(count):
        one = draw(number, rng)
        yield one.what, _finer(one.files[0], finer)


def timed(what: str, tables: Mapping[str, Any], folder: Path) -> Timed:
    """Return the times of a scene; its results go to a new folder."""
    scene = file_scene(Description("drawn.toml", tables, {}))
    study = Study.from_dict({"name": "one"}, scene)
    store = Store(folder)
    told = estimate(study, store).cpu_seconds
    assert told is not None
    began = time.process_time()
    compute_here(study, store)
    return Timed(what, *told, time.process_time() - began)


def _finer(tables: Any, factor: float) -> Any:
    if isinstance(tables, Mapping):
        return {
            key: each / factor if key == "size" else _finer(each, factor)
            for key, each in tables.items()
        }
    return [_finer(each, factor) for each in tables] if isinstance(tables, list) else tables


def main(arguments: Sequence[str]) -> int:
    """Print what is outside, and how many are inside; return 1 if fewer than nine in ten are."""
    count, inside = int(arguments[0]) if arguments else 26, []
    with TemporaryDirectory() as folder:
        for finer in (1.0, 3.0):
            for k, scene in enumerate(drawn(count, finer)):
                found = timed(*scene, Path(folder) / f"{finer}-{k}")
                inside.append(found.inside)
                if not found.inside:
                    print(f"{found.what}: {found.took:.2f} s, {found.low:.2f} to {found.high:.2f}")
    print(f"{sum(inside)} of {len(inside)} own scenes took as long as was estimated")
    return int(sum(inside) < 0.9 * len(inside))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
