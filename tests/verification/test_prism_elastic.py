"""An elastic prism against exact fields, the plane solver, half-space and beam."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import expm

from solver import Body, Material, Model, ModelError, solve
from solver.fem.surface import edges_of
from solver.materials.elasticity import Elasticity
from solver.mesh import graded, grid, mapped
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.rolling.rail.far_field import FarField, sampled_answers
from solver.rolling.rail.modes import Modes
from solver.rolling.rail.section import Section
from solver.tensors import SQRT2
from tests.verification.closed_forms import HertzEllipse
from tests.verification.prism_fields import response, rows_of

Array = NDArray[np.float64]

STEEL = Elasticity(youngs_modulus=2.1e5, poisson_ratio=0.3)
ROUNDING = 1e-9


def skewed(n: int = 3) -> Section:
    """Parallelograms, 4 by 3 mm: polynomials are integrated exactly on them."""
    mesh = grid(np.linspace(0.0, 4.0, n + 1), np.linspace(0.0, 3.0, n))
    slanted = mapped(mesh, lambda p: np.array([[1.0, 0.3], [0.2, 1.0]]) @ p)
    return Section(slanted, STEEL, supports={"bottom": "xyz"})


def full(section: Section, k: float) -> Array:
    """K_k on all unknowns, supported ones too, dense."""
    stiffness = section.stiffness(np.arange(section.n))
    upper = stiffness.pattern.copy()
    upper.data = stiffness.at(k)
    K = upper.toarray()
    K += np.triu(K, 1).T
    return K


def tractions(section: Section, traction, points: int = 6) -> Array:  # type: ignore[no-untyped-def]
    """Nodal forces (n,) of ``traction((z, y), (n_y, n_z)) -> (3, ...)`` on the whole boundary."""
    forces = np.zeros(section.n)
    X = section.plane.X
    for name in section.plane.body.mesh.boundaries:
        edges = edges_of(section.plane, name)
        for xi, weight in zip(*np.polynomial.legendre.leggauss(points), strict=True):
            N = shape_functions(np.array(xi), 3)
            at, along = X[:, edges] @ N, X[:, edges] @ shape_derivatives(np.array(xi), 3)
            outward = np.stack(
                [-along[0], along[1]]
            )  # (y, z) times length; the body is on the left
            pushed = weight * traction(at, outward)
            for axis in range(3):
                np.add.at(forces, 3 * edges + axis, pushed[axis][:, None] * N)
    return forces


def on_boundary(stress: Array, outward: Array) -> Array:
    """Traction (3, n) times length of a Mandel stress (6, n) on normals (y, z) (2, n)."""
    _, yy, zz, xy, yz, zx = stress
    y, z = outward
    return np.stack([(xy * y + zx * z) / SQRT2, yy * y + yz * z / SQRT2, zz * z + yz * y / SQRT2])


def strain_of(k: float, U: Array, dy: Array, dz: Array) -> Array:
    """Mandel strain amplitudes (6, ...) of U (3, ...) and its slopes."""
    return np.stack([
        -k * U[0], dy[1], dz[2], (dy[0] + k * U[1]) / SQRT2,
        (dy[2] + dz[1]) / SQRT2, (dz[0] + k * U[2]) / SQRT2,
    ])  # fmt: skip


def linear_field(k: float, places: Array) -> tuple[Array, Array]:
    """A linear U (3, n) at places (z, y) and its strain (6, n)."""
    rng = np.random.default_rng(4)
    start, dy, dz = rng.standard_normal((3, 3, 1))
    z, y = places
    U = start + dy * y + dz * z
    return U, strain_of(k, U, np.broadcast_to(dy, U.shape), np.broadcast_to(dz, U.shape))


def wave_field(k: float, places: Array) -> tuple[Array, Array]:
    """The gradient of the harmonic e^{ikx} e^{0.6 k y + 0.8 k z}: U (3, n), strain (6, n)."""
    a, b = 0.6 * k, 0.8 * k
    z, y = places
    phi = np.exp(a * y + b * z)
    U = np.stack([k * phi, a * phi, b * phi])
    return U, strain_of(k, U, a * U, b * U)


def point_strain(section: Section, k: float, u: Array) -> Array:
    """Strain (6, n_points) of nodal amplitudes (n,)."""
    B = section.B0 + k * section.B1
    return np.einsum("epci,ei->cep", B, u[section.dofs]).reshape(6, -1)


def test_a_linear_wave_has_its_exact_strain() -> None:
    section, k = skewed(), 0.7
    U, _ = linear_field(k, section.plane.X)
    _, exact = linear_field(k, section.points.reshape(2, -1))
    assert point_strain(section, k, U.T.ravel()) == pytest.approx(exact, abs=1e-13)


def test_nodal_forces_of_a_linear_wave_are_its_tractions_and_body_forces() -> None:
    """Patch test: sigma_ij,j + b_i = 0 with b from the slopes of the stress."""
    section, k = skewed(), 0.7
    C = STEEL.stiffness(6)
    U, _ = linear_field(k, section.plane.X)

    def stress(places: Array) -> Array:
        return np.asarray(C @ linear_field(k, places)[1])

    def slope(places: Array, axis: int) -> Array:
        step = np.zeros((2, 1))
        step[axis] = 0.5
        return stress(places + step) - stress(places - step)  # stress is linear

    def body_force(places: Array) -> Array:
        s, dz, dy = stress(places), slope(places, 0), slope(places, 1)
        return np.stack([
            -k * s[0] - (dy[3] + dz[5]) / SQRT2,
            (k * s[3] - dz[4]) / SQRT2 - dy[1],
            (k * s[5] - dy[4]) / SQRT2 - dz[2],
        ])  # fmt: skip

    forces = tractions(section, lambda at, outward: on_boundary(stress(at), outward))
    b = body_force(section.points.reshape(2, -1)).reshape(3, *section.weights.shape)
    N = section.B1[:, :, 0, 0::3] * -1.0
    each = np.einsum("epn,aep,ep->ena", N, b, section.weights)
    np.add.at(forces, section.dofs, each.reshape(len(each), -1))
    assert full(section, k) @ U.T.ravel() == pytest.approx(forces, abs=1e-12 * np.abs(forces).max())


def test_strain_of_an_exact_wave_converges() -> None:
    """Second order or better at the points: elements of 2 x 2 points are superconvergent there."""
    k, errors = 0.5, []
    for n in (4, 8):
        section = skewed(n)

        def traction(at: Array, outward: Array) -> Array:
            return on_boundary(STEEL.stiffness(6) @ wave_field(k, at)[1], outward)

        u = np.linalg.solve(full(section, k), tractions(section, traction))
        exact = wave_field(k, section.points.reshape(2, -1))[1]
        errors.append(np.abs(point_strain(section, k, u) - exact).max() / np.abs(exact).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 2**2


def test_stiffness_is_positive_and_only_rigid_motions_are_free_at_k_zero() -> None:
    section = skewed()
    values = np.linalg.eigvalsh(full(section, 0.0))
    assert np.abs(values[:4]).max() < 1e-12 * values[-1]
    assert values[4] > 1e-6 * values[-1]
    assert np.abs(full(section, 0.0) @ section.rigid).max() < 1e-11 * values[-1]
    assert np.linalg.eigvalsh(full(section, 0.3))[0] > 1e-6 * values[-1]
    flipped = np.tile([-1.0, 1.0, 1.0], section.n // 3)
    assert full(section, -0.3) == pytest.approx(full(section, 0.3) * np.outer(flipped, flipped))


# -- all waves together --------------------------------------------------------------------------


def block(
    h: float, half: float = 3.0, deep: float = 3.0, reach: float = 12.0, ratio: float = 1.6
) -> tuple[Section, NDArray[np.bool_]]:
    """A block held below and at its sides, and its zone of square elements under the top."""
    inner = np.arange(-half, half + h / 2, h)
    outer = half + graded(reach - half, h, ratio, reach)[1:]
    below = np.append(
        np.arange(0.0, deep + h / 2, h), deep + graded(reach - deep, h, ratio, reach)[1:]
    )
    mesh = grid(np.concatenate([-outer[::-1], inner, outer]), -below[::-1])
    middle = mesh.p[:, mesh.t].mean(axis=1)
    zone = (np.abs(middle[0]) < half) & (middle[1] > -deep)
    return Section(mesh, STEEL, supports=dict.fromkeys(("bottom", "left", "right"), "xyz")), zone


def on_top(section: Section, half: float) -> NDArray[np.int64]:
    """Nodes of the top up to a distance from the middle."""
    nodes = section.plane.boundary_nodes("top")
    return nodes[np.abs(section.plane.X[0, nodes]) < half + 1e-9]


def random_fields(modes: Modes) -> tuple[Array, Array]:
    """Eigenstress and surface forces of no symmetry."""
    rng = np.random.default_rng(8)
    window = len(modes.x)
    eigenstress = rng.standard_normal((len(modes.points), window, 6))
    return 100.0 * eigenstress, rng.standard_normal((len(modes.along), window))


def test_the_condensed_prism_is_the_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    section, zone = block(1.0, reach=8.0)
    rows = rows_of(section, on_top(section, 3.0))
    condensed = Modes(section, zone, 16.0, 8, surface=rows)
    eigenstress, forces = random_fields(condensed)
    found = response(condensed, eigenstress, forces)
    whole = Modes(section, np.ones_like(zone), 16.0, 8, surface=rows)
    everywhere = np.zeros((len(whole.points), 8, 6))
    everywhere[condensed.points] = eigenstress
    exact = response(whole, everywhere, forces)
    size = np.abs(exact.strain).max()
    assert found.strain == pytest.approx(exact.strain[condensed.points], abs=ROUNDING * size)
    size = np.abs(exact.displacement).max()
    assert found.displacement == pytest.approx(exact.displacement, abs=ROUNDING * size)
    by_columns = condensed.displacement(condensed.nodal(eigenstress) + condensed.pushed(forces))
    assert by_columns == pytest.approx(exact.displacement, abs=ROUNDING * size)
    monkeypatch.setenv("RESIDUA_LINEAR_SOLVER", "superlu")
    other = response(Modes(section, zone, 16.0, 8, surface=rows), eigenstress, forces)
    assert other.displacement == pytest.approx(exact.displacement, abs=ROUNDING * size)


def test_a_window_is_a_part_of_all_stations() -> None:
    """Also with eigenstress that goes on behind it."""
    section, zone = block(1.5, reach=8.0)
    rows = rows_of(section, on_top(section, 3.0))
    whole = Modes(section, zone, 16.0, 10, surface=rows)
    fade = np.array([0.8, 0.3, 0.1])
    part = Modes(section, zone, 16.0, 10, window=7, behind=fade, surface=rows)
    eigenstress, forces = random_fields(part)
    found = response(part, eigenstress, forces)
    everywhere = np.concatenate([eigenstress, eigenstress[:, -1:] * fade[:, None]], axis=1)
    exact = response(whole, everywhere, np.pad(forces, ((0, 0), (0, 3))))
    size = np.abs(exact.strain).max()
    assert found.strain == pytest.approx(exact.strain[:, :7], abs=ROUNDING * size)
    assert part.x == pytest.approx(whole.x[:7])
    assert whole.x == pytest.approx(-1.6 * np.arange(10))


def test_a_shift_of_the_load_shifts_the_response() -> None:
    section, zone = block(1.5, reach=8.0)
    modes = Modes(section, zone, 16.0, 10, surface=rows_of(section, on_top(section, 3.0)))
    eigenstress, forces = random_fields(modes)
    one = response(modes, eigenstress, forces)
    other = response(modes, np.roll(eigenstress, 3, axis=1), np.roll(forces, 3, axis=1))
    size = np.abs(one.strain).max()
    assert other.strain == pytest.approx(np.roll(one.strain, 3, axis=1), abs=ROUNDING * size)


def test_forces_and_eigenstress_are_reciprocal() -> None:
    """Betti: the work of the eigenstress in the strain of the forces is that of the forces."""
    section, zone = block(1.5, reach=8.0)
    modes = Modes(section, zone, 16.0, 10, surface=rows_of(section, on_top(section, 3.0)))
    eigenstress, forces = random_fields(modes)
    of_forces = (response(modes, forces=forces).strain * eigenstress).sum(
        axis=(1, 2)
    ) @ modes.weights
    of_stress = (response(modes, eigenstress).displacement * forces).sum()
    assert of_forces == pytest.approx(of_stress, rel=ROUNDING)


def test_the_kernel_is_the_response_to_one_station() -> None:
    section, zone = block(1.5, reach=8.0)
    modes = Modes(section, zone, 16.0, 10, surface=rows_of(section, on_top(section, 3.0)))
    _, forces = random_fields(modes)
    exact = response(modes, forces=forces).displacement
    apart = (np.arange(10)[:, None] - np.arange(10)) % 10
    found = np.einsum("ijcd,jd->ic", modes.kernel[:, :, apart], forces)
    assert found == pytest.approx(exact, abs=ROUNDING * np.abs(exact).max())


def test_loads_constant_along_the_prism_are_plane_strain() -> None:
    section, zone = block(1.0, reach=8.0)
    body = Body(
        name="block",
        mesh=section.plane.body.mesh.with_boundaries(
            {"loaded": lambda x: (x[1] > -1e-9) & (np.abs(x[0]) < 2.0)}
        ),
        material=Material(youngs_modulus=2.1e5, poisson_ratio=0.3),
        supports=dict.fromkeys(("bottom", "left", "right"), "xy"),
        pressure={"loaded": 100.0},
        condense=False,
    )
    plane = solve(Model(bodies=(body,)))
    (part,) = plane.system.parts
    (u,) = plane.loaded.state.u
    exact = part.strain(u)  # zz is along the prism there
    nodal = part.loads.at(1.0).reshape(-1, 2)
    nodes = np.flatnonzero(nodal.any(axis=1))
    modes = Modes(section, zone, 20.0, 4, surface=rows_of(section, nodes))
    forces = np.concatenate([0 * nodes, nodal[nodes, 1], nodal[nodes, 0]])
    strain = response(modes, forces=np.tile(forces[:, None], 4)).strain
    expected = np.zeros((len(modes.points), 4, 6))
    expected[..., [2, 1, 4]] = exact[[0, 1, 3]][:, modes.points, None].transpose(1, 2, 0)
    assert strain == pytest.approx(expected, abs=ROUNDING * np.abs(exact).max())


def sampled_hertz(
    section: Section, half: float, x: Array, ellipse: HertzEllipse
) -> tuple[NDArray[np.int64], Array]:
    """Nodes of the top and forces on them, along x, y, z, at stations x: an elliptic pressure."""
    edges = edges_of(section.plane, "top")
    z = section.plane.X[0]
    edges = edges[(np.abs(z[edges]) < half + 1e-9).all(axis=1)]
    nodes = np.unique(edges)
    forces = np.zeros((3, len(nodes), len(x)))
    xi, weights = np.polynomial.legendre.leggauss(24)
    N = shape_functions(xi, 3)
    size = np.abs(z[edges[:, 1]] - z[edges[:, 0]])[:, None] / 2 * weights
    for c, place in enumerate(x):
        pushed = ellipse.pressure(place, z[edges] @ N.T) * size
        np.add.at(forces[1, :, c], np.searchsorted(nodes, edges), -pushed @ N)
    return nodes, forces.reshape(-1, len(x))


@cache
def pressed(length: float, h: float) -> tuple[Modes, Array, Array]:
    """A wide block under an elliptic pressure: prism, stress with and without far field.

    Elements and stations are as long; the station in the middle is under the centre.
    """
    section, zone = block(h, half=10.0, deep=10.0, reach=300.0, ratio=2.0)
    ahead = round(8.0 / h)
    x = h * (ahead - np.arange(2 * ahead + 1))
    nodes, forces = sampled_hertz(section, 10.0, x, ELLIPSE)
    modes = Modes(section, zone, length, round(length / h), window=len(x),
                  surface=rows_of(section, nodes))  # fmt: skip
    near = response(modes, forces=forces).strain
    far = FarField(modes, modes.x[ahead], levels=2)
    C = STEEL.stiffness(6)
    return modes, (near + far.strain @ far.resultants(forces)) @ C, near @ C


ELLIPSE = HertzEllipse(a=8.3, b=6.3, peak_pressure=1360.0)


def deeper(modes: Modes) -> NDArray[np.int64]:
    """Points of the middle of the zone from 2 mm down.

    Closer to the surface waves shorter than two stations count, which stations cannot carry.
    """
    z, y = modes.section.points.reshape(2, -1)[:, modes.points]
    return np.flatnonzero((y < -2.0) & (y > -9.0) & (np.abs(z) < 6.0))


@pytest.mark.parametrize(("h", "below"), [(2.0, 0.01), (1.0, 0.0025)])
def test_stress_under_an_elliptic_pressure_is_that_of_the_half_space(
    h: float, below: float
) -> None:
    """From 2 mm down, L = 64: 0.93 % of the largest pressure with 2 mm, 0.19 % with 1 mm."""
    modes, stress, _ = pressed(64.0, h)
    some = deeper(modes)
    z, y = modes.section.points.reshape(2, -1)[:, modes.points[some]]
    centre = len(modes.x) // 2
    for station in (centre, centre - round(4.0 / h)):
        ahead = np.full(len(some), modes.x[station] - modes.x[centre])
        exact = ELLIPSE.stress(ahead, -y, z, STEEL.poisson_ratio).T
        error = np.abs(stress[some, station] - exact).max() / ELLIPSE.peak_pressure
        assert error < below


def test_the_surface_under_a_circular_pressure_is_hertzs_paraboloid() -> None:
    """Across the prism and along it. K.L. Johnson, Contact Mechanics (1985), (3.41a).

    Relative to the centre: the block sinks less than a half-space does. With 2 mm measured 0.7 %,
    mostly along the prism, where stations sample the edge of the pressure; stations of 1 and 0.5 mm
    leave 0.45 and 0.14 %.
    """
    circle = HertzEllipse(a=8.0, b=8.0, peak_pressure=1000.0)
    section, zone = block(2.0, half=10.0, deep=10.0, reach=300.0, ratio=2.0)
    x = 2.0 * (4 - np.arange(9))
    nodes, forces = sampled_hertz(section, 10.0, x, circle)
    modes = Modes(section, zone, 64.0, 32, window=9, surface=rows_of(section, nodes))
    far = FarField(modes, modes.x[4], levels=2)
    u = response(modes, forces=forces).displacement + far.displacement @ far.resultants(forces)
    up = u[len(nodes) : 2 * len(nodes)]
    z = section.plane.X[0, nodes]
    middle = int(np.abs(z).argmin())
    modulus = STEEL.plane_strain_modulus
    inside = z[:, None] ** 2 + x**2 < 6.0**2
    exact = np.pi * circle.peak_pressure / (4 * circle.a * modulus) * (z[:, None] ** 2 + x**2)
    raised = up - up[middle, 4]
    assert raised[inside] == pytest.approx(exact[inside], abs=0.01 * exact[inside].max())


def test_the_far_field_stands_for_a_longer_prism() -> None:
    """Without it, stress errs by the loads at the distance L; with it, L does not matter."""
    short, long = pressed(64.0, 2.0), pressed(128.0, 2.0)
    some = deeper(short[0])
    far, near = (np.abs(short[k] - long[k])[some].max() / ELLIPSE.peak_pressure for k in (1, 2))
    assert far < 3e-4
    assert near > 3e-3


@cache
def rail() -> tuple[Section, float]:
    """A bar of 30 x 60 mm on springs, and its foundation [N/mm2]; the beam is slender on it."""
    mesh = grid(np.linspace(-15.0, 15.0, 3), np.linspace(-60.0, 0.0, 7))
    spring = 1.0 / 30.0
    return Section(mesh, STEEL, springs={"bottom": (spring / 1000, spring, spring)}), 1.0


@pytest.mark.parametrize("length", [512.0, 4096.0])
def test_a_bar_on_springs_is_the_endless_beam(length: float) -> None:
    """Deflection and bending stress; at L = 512 alone it would sink more than three times as far.

    M. Hetenyi, Beams on Elastic Foundation (1946), chapter II: shear is left out there.
    """
    section, foundation = rail()
    E, inertia, force = 2.1e5, 30.0 * 60.0**3 / 12, 1000.0
    top = on_top(section, 15.0)
    n = round(length / 16.0)
    modes = Modes(section, np.ones(len(section.weights), bool), length, n,
                  surface=rows_of(section, top))  # fmt: skip
    middle = len(top) + int(np.abs(section.plane.X[0, top]).argmin())
    forces = np.zeros((3 * len(top), n))
    forces[middle, n // 2] = -force / 16.0
    near = response(modes, forces=forces)
    far = FarField(modes, modes.x[n // 2])
    resultants = far.resultants(forces)
    assert resultants == pytest.approx([0.0, -force, 0.0, 0.0], abs=1e-9)
    sunk = -(near.displacement + far.displacement @ resultants)[middle]
    lowest = int(section.points.reshape(2, -1)[1].argmin())
    arm = -section.points.reshape(2, -1)[1, lowest] - 30.0
    stress = E * (near.strain + far.strain @ resultants)[lowest, :, 0]
    root = (foundation / (4 * E * inertia)) ** 0.25
    x = np.abs(modes.x - modes.x[n // 2])
    some = (x > 90.0) & (x < min(1600.0, 0.45 * length))
    fade, turn = np.exp(-root * x), root * x
    beam = force * root / (2 * foundation) * fade * (np.cos(turn) + np.sin(turn))
    bending = force / (4 * root) * fade * (np.cos(turn) - np.sin(turn)) * arm / inertia
    assert sunk[some] == pytest.approx(beam[some], abs=0.003 * beam.max())
    assert stress[some] == pytest.approx(bending[some], abs=0.003 * bending.max())
    if length == 512.0:
        assert -near.displacement[middle, some].min() > 3 * beam.max()


def test_answers_at_a_few_wavenumbers_tell_those_at_all() -> None:
    """The longest waves bend the bar on its springs, the shortest ones end within the section."""
    section, _ = rail()
    forces = np.zeros((section.n, 2))
    forces[3 * on_top(section, 15.0) + 1, 0] = 1.0
    forces[3 * on_top(section, 5.0), 1] = 1.0
    k = -np.append(0.0, np.geomspace(1e-5, 0.6, 120))
    basis, shares = sampled_answers(section, forces, k)
    assert basis.shape[1] < 4 * 30
    for wave in (0, 1, 60, 75, 90, 105, 119, 120):
        exact = np.linalg.solve(full(section, k[wave]), forces)
        off = np.abs(basis @ shares[:, wave] - exact).max(axis=0)
        assert (off < 1e-6 * np.abs(exact).max(axis=0)).all()


def turned(spring: float, poisson_ratio: float) -> tuple[Array, Array]:
    """A head of 60 x 100 mm on springs [N/mm3], pushed beside its middle every 64 mm.

    The stress in the upper part [MPa], and the mean sinking of the vertex that is pushed [mm].
    """
    rubber = Elasticity(youngs_modulus=2e5, poisson_ratio=poisson_ratio)
    mesh = grid(np.linspace(-30.0, 30.0, 7), np.linspace(-100.0, 0.0, 11))
    section = Section(mesh, rubber, springs={"bottom": (spring, spring, spring)})
    top = on_top(section, 30.0)
    modes = Modes(section, section.points[1].mean(axis=1) > -40.0, 64.0, 8,
                  surface=rows_of(section, top))  # fmt: skip
    at = len(top) + int(np.abs(section.plane.X[0, top] - 25.0).argmin())
    forces = np.zeros((3 * len(top), 8))
    forces[at, 0] = -1.0
    found = response(modes, forces=forces)
    return found.strain @ rubber.stiffness(6), -found.displacement[at].mean()


def test_soft_springs_do_not_disturb_a_nearly_incompressible_section() -> None:
    """It turns by radians; the stress is that on springs a hundred times stiffer.

    With that turn in the solution rounding changes them by 2e-4 and 1.4e-3.
    """
    soft, stiff = (turned(spring, 0.4999) for spring in (1e-4, 1e-2))
    assert np.abs(soft[0] - stiff[0]).max() < 1e-4 * np.abs(stiff[0]).max()
    width = 60.0
    sunk = (1.0 / width + 25.0**2 / (width**3 / 12)) / 8 / 1e-4  # of a stiff head
    assert soft[1] == pytest.approx(sunk, rel=1e-6)


def sunk_and_bent(span: float, foundation: float, force: float) -> Array:
    """Deflection and moment in the middle of a clamped beam of the bar on springs, with shear.

    S.P. Timoshenko, Phil. Mag. 41 (1921) 744-746; shear coefficient 0.85 of a rectangle (G.R.
    Cowper, J. Appl. Mech. 33 (1966) 335-340).
    """
    E, shear = 2.1e5, 2.1e5 / 2.6 * 0.85 * 30.0 * 60.0
    # (deflection, turn, moment, shear force)' along the beam
    slope = [[0, 1, 0, 1 / shear], [0, 0, 12 / (E * 30.0 * 60.0**3), 0], [0, 0, 0, -1],
             [foundation, 0, 0, 0]]  # fmt: skip
    held = expm(np.array(slope) * span / 2)[:2]
    return np.asarray(np.linalg.solve(held[:, [0, 2]], held[:, 3] * force / 2))


@pytest.mark.parametrize("span", [900.0, 2400.0])
def test_a_clamped_bar_is_the_clamped_beam(span: float) -> None:
    """What ends change, in the middle: deflection and bending; measured 0.5 and 0.8 %.

    The shorter bar sinks a twentieth of the endless one; the longer one bends more than that.
    """
    section, foundation = rail()
    top, force = on_top(section, 15.0), 1000.0
    modes = Modes(section, np.ones(len(section.weights), bool), 256.0, 16,
                  surface=rows_of(section, top))  # fmt: skip
    endless, clamped = (FarField(modes, modes.x[8], span=each) for each in (None, span))
    down = np.array([0.0, -force, 0.0, 0.0])
    lowest = int(section.points.reshape(2, -1)[1].argmin())
    arm = -section.points.reshape(2, -1)[1, lowest] - 30.0
    stiffness = 2.1e5 * 30.0 * 60.0**3 / 12
    found = [
        -((clamped.displacement - endless.displacement)[len(top), 8] @ down),
        stiffness * ((clamped.strain - endless.strain)[lowest, 8, 0] @ down) / arm,
    ]
    beam = sunk_and_bent(span, foundation, force) - sunk_and_bent(20e3, foundation, force)
    assert found == pytest.approx(beam * [1, -1], rel=0.01)


@cache
def long_bar() -> tuple[Modes, FarField, FarField]:
    """The bar, its far field where it is endless, and where it is clamped at both ends."""
    section, _ = rail()
    rows = rows_of(section, on_top(section, 15.0))
    modes = Modes(section, np.ones(len(section.weights), bool), 2048.0, 128, surface=rows)
    endless, clamped = (FarField(modes, modes.x[64], levels=3, span=span) for span in (None, 960.0))
    return modes, endless, clamped


@pytest.mark.parametrize("resultant", range(4))
def test_a_clamped_bar_does_not_move_at_its_ends(resultant: int) -> None:
    """0.25 % at most of the endless one's motion there: the section is held in the mean."""
    section, _ = rail()
    rows = rows_of(section, on_top(section, 15.0))
    modes, endless, clamped = long_bar()
    middle, at_ends = 64, [34, 94]
    forces = np.zeros((rows.shape[0], 128))
    forces[:, middle] = np.linalg.pinv((rows @ section.rigid).T)[:, resultant] / 16.0
    near = response(modes, forces=forces).displacement[:, at_ends]
    held, moved = (
        np.abs(near + far.displacement[:, at_ends] @ far.resultants(forces)).max()
        for far in (clamped, endless)
    )
    assert held < 0.003 * moved


@cache
def resting(length: float) -> tuple[Modes, FarField, sparse.csr_array]:
    """The bar held along as across, stations of 16 mm; its far field, and the rows of its top."""
    mesh = grid(np.linspace(-15.0, 15.0, 3), np.linspace(-60.0, 0.0, 7))
    section = Section(mesh, STEEL, springs={"bottom": (0.03, 0.03, 0.03)})
    rows = rows_of(section, on_top(section, 15.0))
    modes = Modes(section, np.ones(len(section.weights), bool), length, round(length / 16.0),
                  window=11, surface=rows)  # fmt: skip
    return modes, FarField(modes, modes.x[5]), rows


@pytest.mark.parametrize("resultant", range(4))
def test_each_resultant_has_its_far_field(resultant: int) -> None:
    """Force along x, y, z or moment about x; near the load the length does not matter.

    What is left at L = 512 are the shapes of forces that no resultant tells, from one length away.
    """
    found, alone = [], []
    for length in (512.0, 4096.0):
        modes, far, rows = resting(length)
        section = modes.section
        shape = (rows @ section.rigid)[:, resultant]
        deep = section.points[1].ravel() < -40.0  # above, stations do not resolve the load
        forces = np.zeros((len(shape), 11))
        forces[:, 5] = shape / 16.0 / (shape @ shape)
        near, resultants = response(modes, forces=forces), far.resultants(forces)
        assert resultants[resultant] == pytest.approx(1.0)
        alone.append(near.displacement)
        found.append((near.displacement + far.displacement @ resultants,
                      (near.strain + far.strain @ resultants)[deep]))  # fmt: skip
    for short, long in zip(*found, strict=True):
        assert short == pytest.approx(long, abs=2e-4 * np.abs(long).max())
    assert np.abs(alone[0]).max() > 2 * np.abs(found[0][0]).max()


def test_bad_input_is_told_with_what_is_allowed() -> None:
    section, zone = block(1.5, reach=8.0)
    mesh = section.plane.body.mesh
    with pytest.raises(ModelError, match=r"springs = .*must hold the prism"):
        Section(mesh, STEEL, springs={"bottom": (0.0, 1.0, 1.0)})
    with pytest.raises(ModelError, match=r"springs\.bottom = .*three numbers"):
        Section(mesh, STEEL, springs={"bottom": (1.0, -1.0, 1.0)})
    with pytest.raises(ModelError, match=r"supports\.left = 'w'"):
        Section(mesh, STEEL, supports={"left": "w"})
    for change, told in (
        ({"stations": 7}, "stations = 7: must be even"),
        ({"length": -1.0}, "length = -1.0: must be positive"),
        ({"window": 9}, "window = 9: must be in 1 to 8"),
        ({"window": 5, "behind": [1.0]}, "behind = 1: must have 3 factors"),
        ({"zone": np.zeros_like(zone)}, "must choose some of"),
        ({"surface": rows_of(section, np.array([0]))}, "surface = 0: this row has nodes outside"),
        ({"surface": sparse.csr_array(np.ones((1, section.n)))}, "surface = 0: this row is along"),
    ):
        given = {"zone": zone, "length": 10.0, "stations": 8, **change}
        with pytest.raises(ModelError, match=told):
            Modes(section, **given)
    held = Modes(section, zone, 10.0, 8, surface=rows_of(section, on_top(section, 0.1)))
    carrying = Modes(section, zone, 10.0, 8, surface=rows_of(section, on_top(section, 1.5)))
    for span, told in ((0.0, "must be positive"), (500.0, "must be at most 426.667 mm with 2")):
        with pytest.raises(ModelError, match=f"span = {span}: {told}"):
            FarField(carrying, 0.0, levels=2, span=span)
    with pytest.raises(ModelError, match="surface = '3 rows': must carry forces"):
        FarField(held, 0.0)
