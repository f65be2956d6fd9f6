"""A goal on a model: first yield under a line contact, against the elastic stress of Hertz."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies import Store, Study, open_study
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
