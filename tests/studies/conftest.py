"""Studies of the fake scene, and stores that hold them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from solver.scenes import Scene
from studies import Store, Study
from studies.definition.identity import solver_hash
from studies.execution.task import PathTask, walk
from studies.storage.combine import combine
from studies.storage.ran import MEANINGS
from tests.studies.fakes import FAKE

AXES = {"load_ratio": [0.3, 0.9], "friction": [0.0, 0.4]}


def fake_study(name: str = "fake", sweep: dict[str, Any] | None = None, **fixed: Any) -> Study:
    return Study.from_dict(
        {"name": name, "scene": "fake", "parameters": fixed, "sweep": sweep or AXES}
    )


def compute_here(study: Study, store: Store, scene: Scene = FAKE) -> list[dict[str, Any]]:
    """Compute a study in this process, without a grid; return what the tasks reported."""
    reports: list[dict[str, Any]] = []
    for path in study.paths():
        task = PathTask(scene, (path,), store.directory, solver_hash(), study.keep)
        walk(task, reports.append, lambda: False)
    store.reconcile()
    store.save_study(study)
    combine(study, store, list(study.cases()))
    return reports


def results_of(dataset: xr.Dataset) -> xr.Dataset:
    """Return a data set without what differs from one computation of its runs to the next."""
    return dataset.drop_vars(["cpu_seconds", *MEANINGS], errors="ignore")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "out")


@pytest.fixture(scope="session")
def computed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Store]:
    """A study whose runs all succeeded."""
    study, store = fake_study(), Store(tmp_path_factory.mktemp("computed") / "out")
    compute_here(study, store)
    return study, store


def write_study(folder: Path, text: str = "", **fixed: Any) -> Path:
    """Write a study file of the fake scene, or a text, into a folder."""
    path = folder / "study.toml"
    lines = [f"{name} = {value!r}" for name, value in fixed.items()]
    head = 'name = "fake"\nscene = "fake"\n[parameters]\n' + "\n".join(lines)
    path.write_text(text or f"{head}\n[sweep]\nload_ratio = [0.3, 0.9]\nfriction = [0, 0.4]\n")
    return path


@pytest.fixture
def study_file(tmp_path: Path) -> Callable[..., Path]:
    """Write a study file of the fake scene."""
    return partial(write_study, tmp_path)
