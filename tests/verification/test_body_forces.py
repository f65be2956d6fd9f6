"""Forces per volume against closed forms: weight, and discs that rotate below and beyond yield."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import LimitLoad, Model, ModelError, PathControl, Solution, solve
from solver.fem.discretisation import Discretisation
from solver.fem.loads import nodal_forces
from solver.materials import Elasticity, TrescaMaterial, Voce
from solver.model.body import Body
from solver.model.loads import BodyForce, Centrifugal, Gravity, Pressure, Traction
from tests.verification.bodies import NU, E, block, polar_stress, sector, steel

Array = NDArray[np.float64]

INNER, OUTER, DENSITY, YIELD = 20.0, 100.0, 7.85e-9, 300.0


@dataclass(frozen=True, slots=True)
class RotatingDisc:
    """A thin disc with a hole that rotates, of Tresca's condition without hardening.

    S. Timoshenko, J. N. Goodier, Theory of Elasticity (1970), art. 32; A. Nadai, Theory of Flow and
    Fracture of Solids I (1950), ch. 30: where it flows the hoop stress is the yield stress.

    Attributes
    ----------
    front : radius up to which it flows [mm]
    """

    front: float

    @staticmethod
    def elastic(r: Array, w: float) -> tuple[Array, Array]:
        """Return radial and hoop stress for density times speed squared ``w``."""
        a, b, level = INNER, OUTER, (3 + NU) / 8 * w
        radial = level * (a**2 + b**2 - (a * b / r) ** 2 - r**2)
        hoop = level * (a**2 + b**2 + (a * b / r) ** 2 - (1 + 3 * NU) / (3 + NU) * r**2)
        return radial, hoop

    @property
    def constants(self) -> Array:
        """A and B of the elastic part, A -+ B / r^2, and density times speed squared."""
        a, b, c, e = INNER, OUTER, self.front, (3 + NU) / 8
        rows = [
            [1, -1 / b**2, -e * b**2],
            [1, 1 / c**2, -(1 + 3 * NU) / 8 * c**2],
            [1, -1 / c**2, -e * c**2 + (c**3 - a**3) / (3 * c)],
        ]
        return np.linalg.solve(rows, [0, YIELD, YIELD * (c - a) / c])

    @property
    def speed(self) -> float:
        """Speed at which it flows up to its front [rad/s]."""
        return float(np.sqrt(self.constants[2] / DENSITY))

    def loaded(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress at this speed."""
        A, B, w = self.constants
        flows = r < self.front
        plastic = YIELD * (r - INNER) / r - w * (r**3 - INNER**3) / (3 * r)
        radial = np.where(flows, plastic, A - B / r**2 - (3 + NU) / 8 * w * r**2)
        return radial, np.where(flows, YIELD, A + B / r**2 - (1 + 3 * NU) / 8 * w * r**2)

    def residual(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress after it has stopped."""
        elastic = self.elastic(r, self.constants[2])
        radial, hoop = (a - b for a, b in zip(self.loaded(r), elastic, strict=True))
        return radial, hoop


BURST = float(np.sqrt(3 * YIELD * (OUTER - INNER) / (OUTER**3 - INNER**3) / DENSITY))
"""Speed at which the whole disc flows [rad/s]."""
DISC = RotatingDisc(front=45.0)
TRESCA = TrescaMaterial(
    elasticity=Elasticity(youngs_modulus=E, poisson_ratio=NU),
    curve=Voce(yield_stress=YIELD, saturation=0.0, rate=1.0, modulus=0.0),
)


def disc(speed: float) -> Body:
    """Return half of a thin disc, of 40 elements along the radius."""
    return block(
        "disc", np.linspace(INNER, OUTER, 41), np.linspace(0, 2.0, 2), material=TRESCA,
        kinematics="axisymmetric", supports={"bottom": "y"},
        loads=(Centrifugal(density=DENSITY, speed=speed),), condense=False,
    )  # fmt: skip


def error(solution: Solution, stage: str, exact: tuple[Array, Array], r: Array) -> float:
    """Return the largest error of radial and hoop stress, over the yield stress."""
    stress = solution.system.state("disc", getattr(solution, stage)).stress
    return float(np.abs(stress[[0, 2]] - np.stack(exact)).max() / YIELD)


def test_a_disc_beyond_yield_has_the_stress_of_its_closed_form_turning_and_stopped() -> None:
    """Within 0.5 % of the yield stress everywhere; the hole keeps a hoop stress of -181 MPa."""
    control = PathControl(load_step=0.25, unload_steps=1)
    solution = solve(Model(bodies=(disc(DISC.speed),)), control=control)
    r = solution.system.full("disc").points.reshape(2, -1)[0]
    assert DISC.residual(np.array(INNER))[1] < -0.4 * YIELD
    assert error(solution, "loaded", DISC.loaded(r), r) < 5e-3
    assert error(solution, "unloaded", DISC.residual(r), r) < 5e-3
    assert solution.audit().passed


def test_a_disc_bursts_at_its_limit_speed() -> None:
    """The force at burst grows with the square of speed: 1 % of force is 0.5 % of speed."""
    below = solve(Model(bodies=(disc(0.997 * BURST),)), control=PathControl(load_step=0.25))
    assert below.audit().passed
    with pytest.raises(LimitLoad) as found:
        solve(Model(bodies=(disc(1.1 * BURST),)), control=PathControl(load_step=0.05))
    speed = 1.1 * BURST * np.sqrt(found.value.reached)
    assert speed == pytest.approx(BURST, rel=5e-3)


def test_a_plane_disc_rotates_about_an_axis_across_its_plane() -> None:
    ring = sector(
        np.linspace(INNER, OUTER, 25), 8, kinematics="plane_stress", material=steel(),
        loads=(Centrifugal(density=DENSITY, speed=900.0, axis="z"),), condense=False,
    )  # fmt: skip
    solution = solve(Model(bodies=(ring,)), control=PathControl(load_step=1.0))
    stress = solution.system.state("ring", solution.loaded).stress
    r, *found = polar_stress(solution.system, "ring", stress)
    exact = RotatingDisc.elastic(r, DENSITY * 900.0**2)
    assert np.abs(np.array(found) - exact).max() < 5e-3 * exact[1].max()
    assert solution.audit().passed


@pytest.mark.parametrize("axis", ["y", "z"])
def test_a_centrifugal_force_is_that_of_the_mass_at_its_centroid(axis: Literal["y", "z"]) -> None:
    load = Centrifugal(density=DENSITY, speed=900.0, axis=axis, centre=(-3.0, 7.0))
    body = block("block", np.linspace(2, 10, 5), np.linspace(0, 4, 3), loads=(load,))
    force = nodal_forces(Discretisation(body)).at(1.0).reshape(-1, 2).sum(axis=0)
    exact = DENSITY * 8 * 4 * 900.0**2 * np.array([6.0 + 3.0, (2.0 - 7.0) * (axis == "z")])
    np.testing.assert_allclose(force, exact, rtol=1e-12, atol=1e-12)


def test_a_column_bears_its_weight() -> None:
    """Quadratic elements hold a linear stress exactly; a body force of this size is the same."""
    height, weight = 50.0, DENSITY * 9806.65
    stresses = []
    for load in (Gravity(density=DENSITY), BodyForce(y=-weight), BodyForce(y=lambda x: -weight)):
        column = block("column", np.linspace(0, 10, 3), np.linspace(0, height, 6), loads=(load,),
                       supports={"bottom": "y", "left": "x", "right": "x"})  # fmt: skip
        solution = solve(Model(bodies=(column,)), control=PathControl(load_step=1.0))
        y = solution.nodes("column")[1]
        stresses.append(solution.stress("column", "loaded")[1])
        assert np.allclose(stresses[-1], -weight * (height - y), atol=1e-9 * weight * height)
    assert np.allclose(stresses[1], stresses[0], rtol=0, atol=1e-12)


def test_a_pressure_may_be_a_function_of_position() -> None:
    """A pressure that grows along a face, and the tractions that it is."""
    faces = (
        Pressure(boundary="right", value=lambda x: 2.0 + 0.3 * x[1] ** 2),
        Traction(boundary="right", x=lambda x: -2.0 - 0.3 * x[1] ** 2),
    )
    found = []
    for load in faces:
        body = block("block", np.linspace(0, 10, 5), np.linspace(0, 10, 5), loads=(load,),
                     supports={"left": "xy"})  # fmt: skip
        solution = solve(Model(bodies=(body,)), control=PathControl(load_step=1.0))
        found.append(solution.stress("block", "loaded"))
        assert solution.audit().passed
    assert np.allclose(*found, rtol=0, atol=1e-9)
    assert np.ptp(found[0][0]) > 20.0


@pytest.mark.parametrize(
    ("pressure", "force"),
    [
        (lambda x: np.sqrt(np.maximum(1 - ((x - 5.0) / 3.3) ** 2, 0)), np.pi / 2 * 3.3),
        (lambda x: np.where(x > 4.3, 1.0, 0.0), 5.7),
    ],
    ids=["ellipse", "jump"],
)
def test_a_pressure_may_bend_and_jump(pressure: Callable[[Array], Array], force: float) -> None:
    """The ellipse ends inside edges, the jump is inside one."""
    load = Pressure(boundary="top", value=lambda x: pressure(x[0]))
    body = block("block", np.linspace(0, 10, 6), np.linspace(0, 10, 6), loads=(load,),
                 supports={"bottom": "xy"})  # fmt: skip
    solution = solve(Model(bodies=(body,)), control=PathControl(load_step=1.0))
    assert solution.audit().passed
    nodal = nodal_forces(solution.system.full("block")).at(1.0)
    assert -nodal[1::2].sum() == pytest.approx(force * body.thickness, rel=1e-7)


def test_a_pressure_that_is_zero_but_for_rounding_is_integrated_at_few_points() -> None:
    def zero(x: Array) -> Array:
        assert x.shape[1] < 10**6
        return 100 * (x[0] - 0.3)

    body = block("block", np.linspace(0, 0.3, 4), np.linspace(0, 0.7, 4), supports={"left": "xy"},
                 loads=(Pressure(boundary="right", value=zero),))  # fmt: skip
    assert np.abs(nodal_forces(Discretisation(body)).at(1.0)).max() < 1e-12


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"axis": "x"}, "centrifugal.axis = 'x': must be one of y, z"),
        (
            {"centre": (1.0, 2.0, 3.0)},
            r"centrifugal.centre = .*: must be a tuple \(a number, a number\)",
        ),
    ],
)
def test_an_axis_that_is_none_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        sector(np.linspace(INNER, OUTER, 3), 2, kinematics="plane_stress", material=steel(),
               loads=(Centrifugal(density=DENSITY, speed=1.0, **given),))  # fmt: skip
