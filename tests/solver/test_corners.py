"""Contact surfaces that run around a corner."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skfem import MeshQuad1

from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.mesh import grid

pytestmark = pytest.mark.solves

ELASTIC = Material(youngs_modulus=2e5, poisson_ratio=0.3)
x = np.linspace(0.0, 10.0, 11)


def outlined(mesh: MeshQuad1) -> MeshQuad1:
    """Return a mesh with its right and lower sides as one boundary."""
    both = np.concatenate([mesh.boundaries["right"], mesh.boundaries["bottom"]])
    return mesh.with_boundaries({"outline": both})


def pressed(surface: str, element: str, role: str, **own: Any) -> Solution:
    """Press a block on a wider one, with its lower side alone or with its outline."""
    upper = Body(name="upper", mesh=outlined(grid(x, x)), material=ELASTIC, element=element,
                 supports={"left": "x"}, pressure={"top": 100.0}, condense=False)  # fmt: skip
    lower = Body(name="lower", mesh=grid(np.linspace(0, 20, 17), x - 10), material=ELASTIC,
                 element=element, supports={"left": "x", "bottom": "y"})  # fmt: skip
    sides = [("upper", surface), ("lower", "top")]
    slave, master = sides if role == "slave" else sides[::-1]
    pair = ContactPair(slave=slave, master=master, friction=0.2, **own)
    return solve(Model(bodies=(upper, lower), contacts=(pair,)))


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("role", ["slave", "master"])
def test_a_corner_presses_like_the_end_of_a_side(role: str, element: str, sliding: str) -> None:
    one, other = (pressed(name, element, role, sliding=sliding) for name in ("bottom", "outline"))
    for body in ("upper", "lower"):
        stress = one.stress(body, "loaded")
        assert other.stress(body, "loaded") == pytest.approx(stress, abs=1e-5 * 100.0)
    assert other.audit().passed, other.audit().violations
