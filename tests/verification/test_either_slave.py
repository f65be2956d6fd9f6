"""Either surface of a pair may be the slave: what changes, on meshes that match and that do not."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Model, Solution, Traction, solve
from solver.loading.program import PathControl
from solver.mesh import grid
from solver.mesh.elements import known_elements
from solver.tensors import to_tensor
from tests.verification.bodies import NU, block, cells, steel

P = 100.0
LOADED = 4.0
"""Width of the part of the upper block's top that is loaded [mm], of 10."""
SAME = np.linspace(0.0, 10.0, 21)
OTHER = np.append(np.arange(29) * 0.35, 10.0)


def pressed(
    slave: str, x_lower: np.ndarray = SAME, element: str = "quad8", *, whole: bool = False
) -> Solution:
    """Press a block down on another by its left part, with friction: contact opens at the right."""
    mesh = grid(SAME, np.linspace(0.0, 4.0, 9), cells(element))
    mesh = mesh.with_boundaries(
        {"part": lambda x: (x[1] > 4 - 1e-9) & (x[0] < (10.0 if whole else LOADED))}
    )
    upper = Body(name="upper", mesh=mesh, element=element, material=steel(),
                 supports={"left": "x"}, pressure={"part": P})  # fmt: skip
    lower = block("lower", x_lower, np.linspace(-5.0, 0.0, 11), element,
                  supports={"left": "x", "bottom": "y"})  # fmt: skip
    sides = {"upper": ("upper", "bottom"), "lower": ("lower", "top")}
    master = sides["lower" if slave == "upper" else "upper"]
    pair = ContactPair(slave=sides[slave], master=master, friction=0.0 if whole else 0.2)
    model = Model(bodies=(upper, lower), contacts=(pair,))
    return solve(model, control=PathControl(load_step=0.25))


def from_left(solution: Solution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, pressure and shear along the contact."""
    acting = solution.contact()
    x, pressure, shear = acting.X, acting.pressure, acting.shear
    order = np.argsort(x[0])
    return x[0][order], pressure[order], shear[order]


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("x_lower", [SAME, OTHER], ids=["matching", "non_matching"])
@pytest.mark.parametrize("slave", ["upper", "lower"])
def test_uniform_pressure_passes_from_either_side(
    slave: str, x_lower: np.ndarray, element: str
) -> None:
    solution = pressed(slave, x_lower, element, whole=True)
    _, pressure, shear = from_left(solution)
    assert pressure == pytest.approx(np.full_like(pressure, P), rel=1e-10)
    assert not shear.any()
    for name in ("upper", "lower"):
        stress = to_tensor(solution.system.state(name, solution.loaded).stress)
        exact = np.array([0.0, -P, -NU * P, 0.0])[:, None]
        assert np.abs(stress - exact).max() < 1e-10 * P


@pytest.mark.parametrize("element", known_elements(2))
def test_on_matching_meshes_either_slave_gives_the_same_answer(element: str) -> None:
    """Both surfaces have the same hats at the same places: the difference is rounding."""
    one, other = (pressed(slave, element=element) for slave in ("upper", "lower"))
    _, pressure, shear = from_left(one)
    _, pressure_other, shear_other = from_left(other)
    assert 0 < (pressure == 0).sum() < len(pressure)  # a part is open
    assert np.abs(shear).max() > 0.1 * P
    assert pressure_other == pytest.approx(pressure, abs=1e-6 * P)
    assert shear_other == pytest.approx(shear, abs=1e-6 * P)
    for name in ("upper", "lower"):
        u = one.displacement(name, "loaded")
        assert other.displacement(name, "loaded") == pytest.approx(u, abs=1e-8 * np.abs(u).max())


def test_on_meshes_that_do_not_match_the_slave_changes_little() -> None:
    """Measured: 0.1 % of the load in pressure, 0.8 % in shear, 0.1 % of the displacement."""
    one, other = (pressed(slave, OTHER) for slave in ("upper", "lower"))
    x, pressure, shear = from_left(one)
    x_other, pressure_other, shear_other = from_left(other)
    end, end_other = x[pressure > 0].max(), x_other[pressure_other > 0].max()
    assert end == pytest.approx(end_other, abs=0.5)  # an element
    inside = x < 0.8 * end
    for mine, its, least in ((pressure, pressure_other, 2e-3), (shear, shear_other, 1.5e-2)):
        miss = np.abs(np.interp(x, x_other, its) - mine)[inside].max()
        assert 1e-6 * P < miss < least * P
    u, v = (solution.displacement("upper", "loaded") for solution in (one, other))
    assert np.abs(u - v).max() < 2e-3 * np.abs(u).max()


@pytest.mark.parametrize("cells_of_pad", [16, 17, 32])
def test_a_free_pad_stands_on_a_plane_that_is_meshed_as_coarsely(cells_of_pad: int) -> None:
    """It touches at one vertex first, where any small moment would turn it to the next."""
    pad = block("pad", np.linspace(-4.0, 4.0, cells_of_pad + 1), np.linspace(0.0, 6.0, 13),
                loads=(Traction(boundary="top", y=-P),))  # fmt: skip
    pad.mesh.p[1] += pad.mesh.p[0] ** 2 / 80.0 * (1 - pad.mesh.p[1] / 6.0)
    plane = block("plane", np.linspace(-10.0, 10.0, 41), np.linspace(-8.0, 0.0, 17),
                  supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("plane", "top"), master=("pad", "bottom"), friction=0.3)
    found = solve(Model(bodies=(pad, plane), contacts=(pair,)))
    x, pressure, _ = from_left(found)
    normal = found.loaded.state.contacts[0].normal.sum()
    assert normal == pytest.approx(8.0 * P, rel=1e-4)  # some of the normals lean
    assert pressure == pytest.approx(np.interp(-x, x, pressure), abs=0.05 * pressure.max())
