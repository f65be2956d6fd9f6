"""Goals on models: first yield of a line contact, and a loading path that goes on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies import Store, Study, open_study
from studies.kinds.goal.search import Goal
from tests.studies.test_goal import search_here

ROOT = Path(__file__).parents[2]


def first_yield(poisson_ratio: float) -> float:
    """Return p0/k at which the criterion of von Mises is reached below a line contact.

    K.L. Johnson, Contact Mechanics (1985), (4.45): stress on the axis, plane strain.
    """
    z = np.linspace(0.0, 2.0, 20001)  # depth / half-width
    root = np.sqrt(1.0 + z**2)
    x, y = 2.0 * z - (1.0 + 2.0 * z**2) / root, -1.0 / root
    across = poisson_ratio * (x + y)
    return float(1.0 / np.sqrt(((x - y) ** 2 + (y - across) ** 2 + (across - x) ** 2) / 6.0).max())


@pytest.mark.long
def test_first_yield_of_a_line_contact_within_1_percent_in_twelve_runs(tmp_path: Path) -> None:
    exact = first_yield(0.3)
    assert exact == pytest.approx(3.107, abs=5e-4)
    study = Study.from_toml(ROOT / "data/studies/first-yield.toml")
    alone = Study.from_dict(study.to_dict() | {"sweep": {"point": study.sweep["point"][:1]}})
    computed = search_here(alone, Store(tmp_path / "out"))
    assert len(computed) <= 12
    with open_study(tmp_path / "out") as dataset:
        found = np.sqrt(3.0) * dataset["load_ratio"].item()
        low, high = (np.sqrt(3.0) * dataset[f"load_ratio_{end}"].item() for end in ("low", "high"))
    assert found == pytest.approx(exact, rel=0.01)
    assert low <= exact <= high


def test_a_path_that_goes_on_gives_each_run_as_if_it_were_alone(tmp_path: Path) -> None:
    """A coarse punch: loading continues from the bracket, in a few runs instead of a sweep."""
    goal = {"of": "max_plastic_strain", "at": 2e-3, "between": [0.3, 1.5], "within": 0.005}
    mesh = {"smallest_element": 0.08, "growth": 2.5, "friction": 0.3}
    content = {"name": "punch", "scene": "punch", "parameters": mesh, "goal": goal}
    study, store = Study.from_dict(content), Store(tmp_path / "out")
    assert isinstance(study.kind, Goal)
    assert study.kind.goes_on
    computed = search_here(study, store)
    assert len(computed) <= 6
    with open_study(tmp_path / "out") as dataset:
        assert dataset["status"].item() == "ok"
        numbers = dataset["tried_max_plastic_strain"].to_numpy().ravel()
        assert (np.diff(numbers) > 0.0).all()
        tried = dataset["tried_load_ratio"].to_numpy().ravel()
        load = dataset["load_ratio"].item()
        last = dataset["load_ratio_high"].item()
        stored = store.run(dataset["run_high"].item())
    assert np.interp(2e-3, numbers, tried) == (pytest.approx(load, rel=1e-9))
    alone = Study.from_dict(
        {"name": "one", "scene": "punch", "parameters": mesh | {"load_ratio": last}}
    )
    (case,) = alone.cases()
    (record,) = study.problem.path(case.parameters, [last], lambda done: None)
    assert stored is not None
    assert stored["id"] == case.id
    scalars = {k: v for k, v in stored["scalars"].items() if v is not None and k != "cpu_seconds"}
    assert len(scalars) > 20
    assert {name: record.scalars[name] for name in scalars} == scalars
