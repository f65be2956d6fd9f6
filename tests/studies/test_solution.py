"""A solution as a data set."""

from __future__ import annotations

import numpy as np
import pytest

from studies import to_xarray
from tests.solver.test_export import pressed

pytestmark = pytest.mark.solves


def test_a_data_set_has_the_stages_and_all_bodies() -> None:
    found = pressed("quad8")
    dataset = to_xarray(found)
    lower = dataset.where(dataset.body == "lower", drop=True)
    np.testing.assert_allclose(
        lower.stress.sel(stage="unloaded", component="xx"), found.stress("lower")[0]
    )
    np.testing.assert_allclose(
        lower.displacement.sel(stage="loaded", axis="y"), found.displacement("lower", "loaded")[1]
    )
    assert dataset.stress.units == "MPa"
    assert float(dataset.mises.sel(stage="loaded").max()) <= 300.0 * 1.2
    assert dataset.plastic_strain.sel(stage="unloaded").shape == dataset.x.shape
