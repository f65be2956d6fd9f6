"""Whether a study may be accepted, and what it costs; the process that calls it has no FastAPI."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from solver.scenes import Scene
from studies.definition.study import Study
from studies.execution.estimate import Bounds, Estimate, estimate
from studies.storage.store import Store


@dataclass(frozen=True, slots=True)
class Examined:
    """A study that may be accepted.

    Attributes
    ----------
    study : the checked study
    runs : ids of its runs in the order of its cases; one that chooses them has none yet
    estimate : its estimated cost
    """

    study: Study
    runs: list[str]
    estimate: Estimate

    @property
    def costs(self) -> dict[str, str]:
        """The cost as text by name."""
        return self.estimate.costs(self.study.kind.chooses)


def examined(content: dict[str, Any], directory: Path, bounds: Bounds) -> Examined:
    """Return a checked study with its run ids and its cost; called in a separate process."""
    store = Store(directory)

    def find(name: str) -> Scene | None:
        return store.scene(store.scene_id(name))

    study = Study.known(content, find, store.definition, partial(bounds.check_count, store))
    bounds.refuse(runs=study.size)
    cost = estimate(study.checked(), store, bounds)
    return Examined(study, list(study.run_ids()), cost)
