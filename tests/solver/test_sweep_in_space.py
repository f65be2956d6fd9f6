"""Material that flows along rows with the four strain components of a plane, and the six of space.

The reference is the law itself, asked for its response point by point.
"""

from __future__ import annotations

import numpy as np
import pytest

from solver.materials import TrescaMaterial
from solver.rolling.flow import CompiledSweep, LayeredSweep, SteppedSweep, sweep_of
from solver.tensors import SQRT2
from tests.solver.laws import CURVES, HARDENING, LAYERED, STEEL, chaboche, smooth, steel
from tests.solver.yield_surfaces import Hosford

N_ROWS, N_COLUMNS = 7, 9
YIELD_STRAIN = 350.0 / 2e5
LINEAR = {name: steel(name) for name in HARDENING}
OTHERS = {
    "chaboche": chaboche("fading"),
    "tresca": TrescaMaterial(elasticity=STEEL, curve=CURVES["linear"]),
    "hosford": smooth(Hosford(8.0), "linear"),
}
COMPILED = LINEAR | {"layered": LAYERED}
LAWS = COMPILED | OTHERS
AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


def strains(n, seed=1):
    """Smooth strains (n_rows, n_columns + 1, n) beyond yield and back, different in each row."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2 * np.pi, N_COLUMNS + 1)
    amplitude, phase = 2.5 * YIELD_STRAIN * rng.normal(size=(2, N_ROWS, 1, n))
    return amplitude * np.sin(t[:, None] + 1000 * phase)


def started(law, n):
    """The strains, and the state at their beginning: some rows have yielded."""
    first = strains(n, seed=5)[:, 3].T
    return strains(n), law.respond(first, law.initial(N_ROWS, n)).state


def by_points(law, strain, state, parts):
    """Internal variables at the columns, and one increment before, by the law alone."""
    found, ago = [], []
    for before, after in zip(*(np.moveaxis(strain, 1, 0)[k:] for k in (0, 1)), strict=False):
        for part in range(1, parts + 1):
            last, state = (
                state,
                law.respond((before + part / parts * (after - before)).T, state).state,
            )
        found.append(state.packed)
        ago.append(last.packed)
    return np.stack(found, axis=-1), np.stack(ago, axis=-1)


def rotation():
    """A rotation in space, for Mandel vectors (6, 6)."""
    Q = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    scale = np.array([1.0, 1.0, 1.0, SQRT2, SQRT2, SQRT2])
    turned = np.empty((6, 6))
    for column, (a, b) in enumerate(AXES):
        unit = np.zeros((3, 3))
        unit[a, b] = unit[b, a] = 1.0
        tensor = Q @ unit @ Q.T / scale[column]
        turned[:, column] = scale * [tensor[each] for each in AXES]
    return turned


@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("name", LAWS)
def test_rows_have_the_states_of_the_law_point_by_point(name, parts, n):
    law = LAWS[name]
    strain, start = started(law, n)
    sweep = sweep_of(law, strain, start, parts)
    kind = LayeredSweep if name == "layered" else SteppedSweep
    assert type(sweep) is (CompiledSweep if name in LINEAR else kind)
    states, ago = by_points(law, strain, start, parts)
    grown = sweep.states.accumulated[:, -1] - start.accumulated
    assert grown.min() > 0.5 * YIELD_STRAIN
    size = np.abs(states).max(axis=(1, 2), keepdims=True)
    assert (abs(sweep.states.packed - states) <= 1e-11 * size).all()
    assert (abs(sweep.ago.packed - ago) <= 1e-11 * size).all()


@pytest.mark.parametrize("name", LAWS)
def test_rows_in_another_frame_have_the_same_states_in_that_frame(name):
    law, R = LAWS[name], rotation()
    assert np.allclose(R @ R.T, np.eye(6))
    strain, start = started(law, 6)
    turned = law.respond(R @ strains(6, seed=5)[:, 3].T, law.initial(N_ROWS, 6)).state
    here = sweep_of(law, strain, start, 4).states
    there = sweep_of(law, strain @ R.T, turned, 4).states
    expected = np.einsum("ij,j...->i...", R, here.plastic_strain)
    assert abs(here.plastic_strain[4:]).max() > YIELD_STRAIN
    np.testing.assert_allclose(there.plastic_strain, expected, atol=1e-11)
    np.testing.assert_allclose(there.accumulated, here.accumulated, atol=1e-11)


@pytest.mark.parametrize("name", LAWS)
def test_a_plane_path_is_the_same_with_six_components(name):
    law = LAWS[name]
    strain = strains(4)
    plane = sweep_of(law, strain, law.initial(N_ROWS, 4), 4).states
    more = np.concatenate([strain, np.zeros((*strain.shape[:2], 2))], axis=2)
    space = sweep_of(law, more, law.initial(N_ROWS, 6), 4).states
    np.testing.assert_allclose(space.plastic_strain[:4], plane.plastic_strain, atol=1e-14)
    assert not space.plastic_strain[4:].any()


@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize(("name", "parts"), [*((name, 4) for name in COMPILED), ("chaboche", 1)])
def test_changes_of_plastic_strain_are_those_of_differences(name, parts, n):
    law = LAWS[name]
    strain, start = started(law, n)
    added = YIELD_STRAIN * np.random.default_rng(3).normal(size=(N_ROWS, N_COLUMNS, n))
    step = 1e-6

    def moved(size):
        path = strain.copy()
        path[:, 1:] += size * added
        return np.moveaxis(sweep_of(law, path, start, parts).states.plastic_strain, 0, 2)

    differences = (moved(step) - moved(-step)) / (2 * step)
    found = sweep_of(law, strain, start, parts).along(added)[0]
    # a stepped sweep takes differences itself, of first order
    most = 1e-7 if name in COMPILED else 1e-4
    assert np.linalg.norm(found - differences) < most * np.linalg.norm(differences)
