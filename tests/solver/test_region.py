"""Windows of a body under a moving load: few, and the same result as with the whole body."""

from __future__ import annotations

import numpy as np
import pytest

from solver.contact.system import System
from solver.fem import operators
from solver.fem.region import box_around, inside
from solver.linear import pardiso
from solver.loading.control import Control
from solver.loading.walker import Walker
from solver.scenes.rolling import ROLLING
from solver.scenes.rolling_parameters import RollingParameters


def test_a_box_has_all_it_is_for_inside():
    random = np.random.default_rng(1)
    for _ in range(100):
        X = random.normal(size=(2, 5)) * random.lognormal(0, 3) + random.normal(size=(2, 1)) * 50
        assert inside(box_around(X), X).all()


def test_few_boxes_do_for_the_way_of_a_load():
    """36 mm long and 12 mm deep, moved by 50 mm in 500 steps: a lattice of 8 mm."""
    X = np.array([[-18.0, 18.0], [-12.0, 0.0]])
    boxes = {box_around(X + np.array([[x], [0.0]])) for x in np.linspace(-25, 25, 501)}
    assert len(boxes) <= 8
    assert max(across for _, _, across, _ in boxes) <= 24.0


@pytest.mark.solves
@pytest.mark.parametrize("traction", [0.0, 0.5])
def test_a_window_changes_the_result_by_rounding_alone(traction, monkeypatch):
    if pardiso.library() is None:
        pytest.skip("MKL is not installed")
    run = RollingParameters(
        track=24.0, element_size=2.0, advance_step=2.0, growth=1.3, traction=traction
    )
    system = System(ROLLING.model(run))
    made = []

    class Counted(operators.Windowed):
        def __init__(self, *given):
            made.append(1)
            super().__init__(*given)

    found = []
    monkeypatch.setattr(operators, "Windowed", Counted)
    for small in (operators._SMALL, 0.0):
        monkeypatch.setattr(operators, "_SMALL", small)
        system = System(ROLLING.model(run))
        (outcome,) = Walker(system, Control()).walk([ROLLING.program(run)])
        found.append((outcome, len(made)))
    (windowed, some), (whole, all_made) = found
    assert 0 < some == all_made
    assert windowed.tally.iterations == whole.tally.iterations
    stress = [system.response("half_space", o.points["unloaded"]).stress for o in (windowed, whole)]
    assert np.abs(stress[0] - stress[1]).max() < 1e-4
