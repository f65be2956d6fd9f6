"""Gap, slip and their derivative rows on pairs of surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, System
from solver.fem.discretisation import Discretisation
from solver.fem.surface import extract
from solver.mesh import grid, mapped

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
ELEMENTS = ["quad8", "quad4"]


def two_surfaces(
    element="quad8", bend=0.0, gap=0.0, state="plane_strain", thickness=1.0, width=6.0, below=None,
    sliding="finite",
):  # fmt: skip
    """A body of width 6 above one of the given width, bent to y = bend x², or ``below`` x²."""

    def body(name, x, y, held):
        own = bend if name == "upper" or below is None else below

        def arc(p):
            return np.stack([p[0], p[1] + own * p[0] ** 2])

        return Body(
            name=name,
            mesh=mapped(grid(x, y), arc),
            material=STEEL,
            element=element,
            kinematics=state,
            thickness=thickness,
            supports=held,
        )

    x = np.append(np.arange(0.0, width - 0.3, 0.7), width)
    upper = body("upper", np.linspace(0.0, 6.0, 7), gap + np.linspace(0.0, 2.0, 3), {"top": "x"})
    lower = body("lower", x, np.linspace(-2.0, 0.0, 3), {"bottom": "xy"})
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), sliding=sliding)
    system = System(Model(bodies=(upper, lower), contacts=(pair,)))
    return system, system.interfaces[0]


def at_rest(system):
    return [np.zeros(part.n) for part in system.parts]


def rows_on_parts(system, interface, rows):
    """Rows (n, unknowns of the part) for slave and master."""
    out = []
    for (number, _, surface), block in zip(interface.sides, rows, strict=True):
        whole = np.zeros((len(block), system.parts[number].n))
        whole[:, surface.dofs] = block
        out.append(whole)
    return out


@pytest.mark.parametrize("element", ELEMENTS)
def test_areas_under_the_hats_sum_to_the_surface(element):
    system, interface = two_surfaces(element, thickness=3.0)
    assert interface.pairing(at_rest(system)).area.sum() == pytest.approx(18.0, rel=1e-12)
    system, interface = two_surfaces(element, state="axisymmetric")
    assert interface.pairing(at_rest(system)).area.sum() == pytest.approx(36 * np.pi, rel=1e-12)


def test_only_the_part_that_faces_the_master_counts():
    system, interface = two_surfaces(width=4.2)
    pairing = interface.pairing(at_rest(system))
    assert pairing.area.sum() == pytest.approx(4.2, rel=1e-12)
    assert np.isinf(pairing.gap[-1])
    assert pairing.area[-1] == 0.0


@pytest.mark.parametrize("element", ELEMENTS)
def test_gap_of_parallel_surfaces_is_their_distance(element):
    system, interface = two_surfaces(element, gap=0.25)
    assert interface.pairing(at_rest(system)).gap == pytest.approx(np.full(7, 0.25), rel=1e-12)


@pytest.mark.parametrize("element", ELEMENTS)
def test_flat_surfaces_have_exact_gap_rows(element):
    """Where the surfaces touch, a turn of the normal does not change the gap to first order."""
    system, interface = two_surfaces(element)
    rng = np.random.default_rng(2)
    u = at_rest(system)
    rows = rows_on_parts(system, interface, interface.pairing(u).normal)
    step = [1e-5 * rng.standard_normal(len(part)) for part in u]
    up = interface.pairing([a + b for a, b in zip(u, step, strict=True)]).gap
    down = interface.pairing([a - b for a, b in zip(u, step, strict=True)]).gap
    linear = sum(row @ s for row, s in zip(rows, step, strict=True))
    # the ends move in and out of the master's edge: their hats cover more or less
    inner = slice(1, -1)
    # measured 6e-10 of the step, its square times the turn of the normals
    assert (up - down)[inner] / 2 == pytest.approx(linear[inner], abs=1e-8 * 1e-5)


def test_gap_rows_match_central_differences_on_curved_surfaces():
    """Surfaces bent alike: what is left is the faceting of the two meshes, times the step."""
    system, interface = two_surfaces(bend=0.02)
    rng = np.random.default_rng(3)
    u = at_rest(system)
    rows = rows_on_parts(system, interface, interface.pairing(u).normal)
    worst = 0.0
    for _ in range(5):
        step = [1e-5 * rng.standard_normal(len(part)) for part in u]
        up = interface.pairing([a + b for a, b in zip(u, step, strict=True)]).gap
        down = interface.pairing([a - b for a, b in zip(u, step, strict=True)]).gap
        linear = sum(row @ s for row, s in zip(rows, step, strict=True))
        worst = max(worst, np.abs((up - down) / 2 - linear)[1:-1].max() / 1e-5)
    assert worst < 5e-4  # measured 5e-5


def test_gaps_of_a_bow_on_a_plane_change_as_it_turns_and_shifts():
    """Its normals lean under a hat: along them, as forces act, it would turn at no gap's cost."""
    system, interface = two_surfaces(bend=0.05, below=0.0)
    (number, _, surface), _ = interface.sides
    x, y = surface.X

    def gap(motion):
        u = at_rest(system)
        u[number][surface.dofs] = motion.T.ravel()
        return interface.pairing(u).gap

    pairing = interface.pairing(at_rest(system))
    inner, step = slice(1, 3), 1e-5  # where the gap is small against the radius of 10
    for motion in (np.stack([-(y - 10.0), x]), np.stack([np.ones_like(x), 0 * x])):
        change = (gap(step * motion) - gap(-step * motion))[inner] / (2 * step)
        by_work, found = (
            (rows[0] @ motion.T.ravel())[inner] for rows in (pairing.normal, pairing.closing)
        )
        scale = np.abs(motion).max()
        assert np.abs(found - change).max() < 0.01 * scale  # the lean, 0.2, squared or more
        assert np.abs(by_work - change).max() > 0.05 * scale


def test_gaps_of_small_sliding_change_by_any_motion_as_forces_act():
    """They are linear: a lean of the master's normals, which a finite motion sees, is none here."""
    system, interface = two_surfaces(bend=0.05, below=0.0, sliding="small")
    u = [np.random.default_rng(4).normal(size=part.n) for part in system.parts]
    before, after = interface.pairing(at_rest(system)), interface.pairing(u)
    moved = sum(
        block @ u[number][surface.dofs]
        for (number, _, surface), block in zip(interface.sides, after.closing, strict=True)
    )
    assert np.abs(moved - (after.gap - before.gap)).max() < 1e-12


@pytest.mark.parametrize("bend", [0.0, 0.05])
def test_a_common_translation_changes_neither_gap_nor_slip(bend):
    system, interface = two_surfaces(bend=bend)
    pairing = interface.pairing(at_rest(system))
    for rows in (pairing.normal, pairing.tangent, pairing.closing):
        for axis in (0, 1):
            total = sum(block[:, axis::2].sum(axis=1) for block in rows)
            assert np.abs(total).max() < 1e-12


def test_rows_measure_approach_and_slip_of_the_slave():
    """The slave's outward normal is -y, its tangent +x."""
    system, interface = two_surfaces()
    pairing = interface.pairing(at_rest(system))
    on_slave = pairing.normal[0][:, 1::2].sum(axis=1)
    assert on_slave == pytest.approx(np.ones(7))  # raised by 1, the gap grows by 1
    assert pairing.tangent[0][:, 0::2].sum(axis=1) == pytest.approx(np.ones(7))


def test_a_rotation_of_both_bodies_changes_no_gap():
    """Finite sliding follows the current positions, here turned by half a radian."""
    system, interface = two_surfaces(bend=0.03, gap=0.1)
    before = interface.pairing(at_rest(system)).gap
    c, s = np.cos(0.5), np.sin(0.5)
    u = []
    for body in ("upper", "lower"):
        number = system.part(body)
        x = next(surface for part, _, surface in interface.sides if part == number)
        turned = np.zeros(system.parts[number].n)
        turned[x.dofs] = (np.array([[c, -s], [s, c]]) @ x.X - x.X).T.ravel()
        u.append(turned)
    assert interface.pairing(u).gap == pytest.approx(before, rel=1e-10)


def test_surfaces_that_close_upon_themselves_are_refused():
    body = Body(name="ring", mesh=grid(np.arange(3.0), np.arange(3.0)), material=STEEL)
    mesh = body.mesh.with_boundaries({"all": lambda x: np.ones_like(x[0], dtype=bool)})
    ring = Body(name="ring", mesh=mesh, material=STEEL)
    plane = Body(name="plane", mesh=grid(np.arange(3.0), np.arange(-2.0, 1.0)), material=STEEL)
    pair = ContactPair(slave=("ring", "all"), master=("plane", "top"))
    with pytest.raises(ModelError, match=r"boundary = '\w+\.all': .* one open chain"):
        System(Model(bodies=(ring, plane), contacts=(pair,)))


def test_thin_elements_along_a_curve_have_their_body_on_the_right_side():
    """Elements thinner than the sagitta of their edge: the chord does not tell the side."""
    curve = mapped(
        grid(np.array([0.0, 10.0, 20.0]), np.array([0.0, 0.05, 1.0])),
        lambda p: np.stack([p[0], p[1] + p[0] ** 2 / 200]),
    )
    bent = Body(name="bent", mesh=curve, material=STEEL, pressure={"bottom": 100.0})
    assert Discretisation(bent).external(1.0)[1::2].sum() == pytest.approx(100.0 * 20.0)
    chain = extract(Discretisation(bent), "bottom")
    assert chain.X[0, chain.vertices] == pytest.approx([0.0, 10.0, 20.0])
