"""The fillet of a shaft that a roller presses: the scene file `data/scenes/fillet.toml`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from solver.results.record import Record, Status
from studies.scenes.scene import read_scene

FILE = Path(__file__).parents[2] / "data/scenes/fillet.toml"


@pytest.fixture(scope="module", params=["small", "large"])
def record(request: pytest.FixtureRequest) -> Record:
    scene = read_scene(FILE)
    (found,) = scene.path(scene.parameters(strain=request.param), [], lambda share: None)
    return found


def test_the_fillet_is_left_in_compression_below_its_surface(record: Record) -> None:
    assert (record.status, record.message) == (Status.OK, "")
    dims, stress = record.fields["line_stress"]
    assert dims == ("line", "stage", "component", "fraction")
    hoop = stress[0, -1, 2]
    depth = record.fields["line_s"][1][0]
    lowest = int(np.nanargmin(hoop))
    assert 0.05 < depth[lowest] < 0.4, "within a contact half-width, as below any roller"
    assert hoop[lowest] == pytest.approx(record.scalars["hoop"], rel=1e-6)
    assert hoop[lowest] < -300.0 and np.nanmax(hoop[lowest:]) > 10.0, "tension balances it deeper"


def test_the_shaft_carries_the_force_of_the_roller_until_it_is_lifted(record: Record) -> None:
    dims, force = record.fields["reaction_y"]
    assert dims == ("part", "increment") and np.abs(force).max() > 1e4
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-6 * np.abs(force).max())
    assert np.abs(force[:, -1]).max() < 1e-6 * np.abs(force).max()
