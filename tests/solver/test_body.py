"""Bodies, their operators, and what a bad one is told."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, solve
from solver.fem.discretisation import Discretisation
from solver.materials import PlaneStress
from solver.mesh import graded, grid, mapped
from solver.mesh.elements import known_elements
from solver.tensors import SQRT2

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
STATES = ["plane_strain", "plane_stress", "axisymmetric"]


def square(element="quad8", **fields):
    cells = "tri" if element.startswith("tri") else "quad"
    mesh = grid(np.linspace(0.0, 2.0, 4), np.arange(3.0), cells)
    return Body(name="square", element=element, **({"material": STEEL, "mesh": mesh} | fields))


# -- loads and operators -----------------------------------------------------------------------


@pytest.mark.parametrize("element", known_elements(2))
def test_pressure_has_its_resultant(element):
    """100 MPa on a top 2 long and 3 thick pushes down with 600 N."""
    load = Discretisation(square(element, pressure={"top": 100.0}, thickness=3.0)).external(1.0)
    assert load[1::2].sum() == pytest.approx(-600.0)
    assert load[0::2].sum() == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("element", known_elements(2))
def test_axisymmetric_pressure_acts_on_the_whole_disc(element):
    load = Discretisation(
        square(element, pressure={"top": 100.0}, kinematics="axisymmetric")
    ).external(1.0)
    assert load[1::2].sum() == pytest.approx(-100.0 * np.pi * 4.0)


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("state", STATES)
def test_rigid_motions_strain_nothing(element, state):
    part = Discretisation(square(element, kinematics=state))
    assert part.rigid.shape[1] == (1 if state == "axisymmetric" else 3)
    for motion in part.rigid.T:
        assert np.abs(part.strain(motion)).max() < 1e-13


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("state", STATES)
def test_linear_displacements_have_uniform_strain(element, state):
    part = Discretisation(square(element, kinematics=state))
    x, y = part.X
    u = np.stack([1e-3 * x + (0 if state == "axisymmetric" else 4e-3) * y, -2e-3 * y + 3e-3 * x])
    strain = part.strain(u.T.ravel())
    shear = 3e-3 if state == "axisymmetric" else 7e-3
    hoop = 1e-3 if state == "axisymmetric" else 0.0
    expected = np.array([1e-3, -2e-3, hoop, shear / SQRT2])
    assert strain == pytest.approx(np.tile(expected[:, None], strain.shape[1]), abs=1e-14)


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("state", STATES)
def test_internal_forces_do_the_work_of_the_stress(element, state):
    """Virtual work: f . u = integral of stress : strain, for any u and any stress."""
    part = Discretisation(square(element, kinematics=state, thickness=2.0))
    rng = np.random.default_rng(4)
    u, stress = rng.standard_normal(part.n), rng.standard_normal((4, part.weights.size))
    work = (stress * part.strain(u)).sum(axis=0) @ part.weights.ravel()
    assert part.undeformed.internal_force(stress) @ u == pytest.approx(work, rel=1e-12)


@pytest.mark.parametrize("element", known_elements(2))
def test_weights_sum_to_the_volume(element):
    assert Discretisation(square(element, thickness=2.5)).weights.sum() == pytest.approx(10.0)


def test_weights_of_a_ring_sum_to_its_volume():
    ring = grid(np.linspace(1.0, 3.0, 4), np.arange(3.0))
    part = Discretisation(square(mesh=ring, kinematics="axisymmetric"))
    assert part.weights.sum() == pytest.approx(2 * np.pi * (9 - 1))


@pytest.mark.parametrize("element", ["quad8", "quad9", "quad4", "tri6"])
@pytest.mark.parametrize("state", ["plane_strain", "plane_stress"])
def test_tangent_is_the_derivative_of_the_internal_force(element, state):
    part = Discretisation(square(element, kinematics=state, supports={"left": "xy"}))
    rng = np.random.default_rng(6)
    u = 4e-3 * rng.standard_normal(part.n)
    response = part.respond(u, part.virgin(), 0.0)
    assert response.law.yielding.mean() > 0.5
    K = part.pattern.copy()
    K.data = part.tangent_data(response)
    full = (K + K.T).toarray() - np.diag(K.diagonal())
    step = np.zeros(part.n)
    step[part.active] = rng.standard_normal(len(part.active))
    h = 1e-9
    forces = [
        -part.residual(0.0, u, part.respond(u + s * step, part.virgin(), 0.0))[part.active]
        for s in (h, -h)
    ]
    difference = (forces[0] - forces[1]) / (2 * h)
    # truncation h^2 and rounding eps * force / h leave about 1e-6
    assert np.abs(difference - full @ step[part.active]).max() < 1e-5 * np.abs(difference).max()


@pytest.mark.parametrize(
    ("supports", "n_rigid"),
    [
        ({}, 3),
        ({"left": "x"}, 1),
        ({"left": "y"}, 2),
        ({"left": "xy"}, 0),
        ({"left": "x", "bottom": "y"}, 0),
        ({"left": "x", "right": "x"}, 1),
    ],
)
def test_supports_leave_the_rigid_motions_they_do_not_hold(supports, n_rigid):
    part = Discretisation(square(supports=supports))
    assert part.rigid.shape[1] == n_rigid
    K = part.pattern.copy()
    K.data = part.elastic_data
    full = (K + K.T).toarray() - np.diag(K.diagonal())
    assert np.linalg.eigvalsh(full)[0] > 1e-6 * np.abs(full).max()  # pinned: no mechanism left


def test_elastic_stiffness_of_plane_stress_is_youngs_modulus_in_tension():
    C = PlaneStress(STEEL).stiffness(4)
    stress = C @ np.array([1e-3, -0.3e-3, 0.0, 0.0])
    assert stress == pytest.approx([200.0, 0.0, 0.0, 0.0], abs=1e-10)


# -- meshes ------------------------------------------------------------------------------------


def test_graded_nodes_fill_the_length_and_grow():
    nodes = graded(10.0, 0.01, 1.5, 2.0)
    sizes = np.diff(nodes)
    assert nodes[0] == 0.0
    assert nodes[-1] == pytest.approx(10.0)
    assert sizes[0] <= 0.01
    assert (np.diff(sizes) > -1e-12).all()
    assert sizes.max() <= 2.0
    assert (sizes[1:] / sizes[:-1]).max() <= 1.5 + 1e-9


@pytest.mark.parametrize(
    ("arguments", "field"), [((1.0, 2.0, 1.2, 1.0), "smallest"), ((1.0, 0.1, 0.9, 1.0), "ratio")]
)
def test_impossible_gradings_are_refused_by_name(arguments, field):
    with pytest.raises(ModelError, match=f"^{field} = "):
        graded(*arguments)


def test_mapped_meshes_keep_names_and_follow_the_curve():
    quarter = grid(np.linspace(1.0, 2.0, 3), np.linspace(0.0, np.pi / 2, 9))
    ring = mapped(quarter, lambda p: p[0] * np.stack([np.cos(p[1]), np.sin(p[1])]))
    assert set(ring.boundaries) == {"left", "right", "bottom", "top"}
    part = Discretisation(square(mesh=ring))
    # quadratic edges on an arc: relative area error (angle per element)^4 / 720
    assert part.weights.sum() == pytest.approx(np.pi / 4 * 3, rel=1e-4)
    radius = np.hypot(*part.X[:, part.boundary_nodes("left")])
    assert radius == pytest.approx(np.ones_like(radius))


# -- bad input ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kinematics": "plain"}, "kinematics = 'plain': must be one of plane_strain"),
        ({"element": "hex9"}, "element = 'hex9': must be one of quad8"),
        ({"element": "tri6", "mesh": grid(np.arange(3.0), np.arange(3.0))}, "corners"),
        ({"thickness": 0.0}, r"thickness = 0.0: must be greater than 0 \[mm\]"),
        ({"thickness": np.nan}, "thickness = nan: must be a finite number"),
        ({"supports": {"lid": "x"}}, "supports = 'lid': must name a boundary .* left"),
        ({"supports": {"left": "z"}}, "supports.left = 'z': must be x, y or xy"),
        ({"pressure": {"top": np.inf}}, "pressure.top = inf: must be a finite number"),
        (
            {"mesh": grid(np.arange(-1.0, 2.0), np.arange(3.0)), "kinematics": "axisymmetric"},
            "x >= 0",
        ),
    ],
)
def test_bad_bodies_are_refused_by_field_value_and_what_is_allowed(fields, message):
    with pytest.raises(ModelError, match=message):
        square(**fields)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("youngs_modulus", 0.0),
        ("youngs_modulus", np.inf),
        ("poisson_ratio", 0.5),
        ("poisson_ratio", -0.1),
        ("yield_stress", 0.0),
        ("yield_stress", np.nan),
        ("hardening", "strong"),
        ("hardening_ratio", 1.0),
        ("isotropic_fraction", 1.5),
    ],
)
def test_bad_materials_are_refused_by_name(field, value):
    with pytest.raises(ModelError) as outcome:
        Material(**({"youngs_modulus": 2e5, "poisson_ratio": 0.3} | {field: value}))
    assert outcome.value.field == field


def test_models_refuse_what_does_not_fit_together():
    body = square(supports={"bottom": "xy"})
    with pytest.raises(ModelError, match=r"bodies = .* different names"):
        Model(bodies=(body, body))
    with pytest.raises(ModelError, match=r"bodies = \[\]"):
        Model(bodies=())
    other = Body(name="other", mesh=body.mesh, material=STEEL, kinematics="plane_stress")
    with pytest.raises(ModelError, match=r"bodies\.kinematics"):
        Model(bodies=(body, other))
    with pytest.raises(ModelError, match="slave = 'ghost': must be one of square"):
        pair = ContactPair(slave=("ghost", "top"), master=("square", "top"))
        Model(bodies=(body,), contacts=(pair,))


@pytest.mark.parametrize("friction", [-0.1, np.nan, np.inf])
def test_bad_friction_is_refused(friction):
    with pytest.raises(ModelError, match="friction = "):
        ContactPair(slave=("a", "top"), master=("b", "top"), friction=friction)


@pytest.mark.solves
def test_unknown_linear_solver_is_refused():
    model = Model(bodies=(square(supports={"left": "xy"}, pressure={"top": 1.0}),))
    with pytest.raises(ModelError, match="linear_solver = 'lapack': must be one of"):
        solve(model, linear_solver="lapack")
