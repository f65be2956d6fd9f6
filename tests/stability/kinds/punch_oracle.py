"""What a punch must satisfy, computed again without the solver's contact and audit code.

Only displacements, stress and internal variables at the integration points, and the contact
forces are taken from the solver. Equilibrium is tested by virtual work on affine displacements,
which every mesh contains: with ``v = (0, y + L)`` the integral of sigma_yy over a body of length
L is minus the applied force times L, with ``v = (x, 0)`` that of sigma_xx (plus sigma_zz round an
axis) is the work of the friction forces; both vanish after unloading. Contact is tested on the
mean gap under each hat of the punch's surface, integrated here; both bodies have the same nodes
there. Every figure is relative and 0 for a perfect answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.mesh.elements import element_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver import Outcome, System
    from solver.contact.state import Converged
    from solver.scenes.punch import PunchParameters

    Array = NDArray[np.float64]

LIMITS = {
    "force": 1e-7,  # contact resultant against the applied force
    "work_y": 1e-6,  # equilibrium under load: virtual work of the vertical stretch
    "work_x": 1e-6,  # and of the horizontal one, friction included
    "residual_work": 1e-6,  # self-equilibrium after unloading
    "tension": 0.0,  # negative contact force over the applied one
    "cone": 1e-7,  # friction beyond its bound over the applied force
    "overlap": 1e-7,  # negative gap over the largest displacement
    "complementarity": 1e-7,  # force times gap, over applied force times largest displacement
    "left_over": 0.0,  # contact force after unloading
    "yield": 1e-7,  # von Mises stress over the strength
    "law": 1e-8,  # strain less Hooke's and the plastic one, over the largest strain
    "state": 1e-8,  # stress out of plane, plane stress; plastic volume change
    "dissipation": 1e-9,  # negative plastic work over that of the applied force
}


def judge(parameters: PunchParameters, system: System, outcome: Outcome) -> dict[str, float]:
    """Return the figures of `LIMITS` for a punch that was loaded and unloaded."""
    loaded, unloaded = outcome.points["loaded"], outcome.points["unloaded"]
    a = parameters.half_width
    axial = parameters.state == "axisymmetric"
    force = parameters.load_ratio * parameters.yield_stress * a * (np.pi * a if axial else 1.0)
    contact = loaded.state.contacts[0]
    N, T = contact.normal, contact.tangential
    mean, gap = _hats(parameters, system, loaded)
    travel = max(float(np.abs(system.displacement(b, loaded.state)).max()) for b in _BODIES)
    work = {
        "work_y": [_work(system, body, loaded, "y") + force for body in _BODIES],
        "work_x": [
            _work(system, body, loaded, "x") - sign * float(T @ mean) / _length(system, body, 0)
            for body, sign in zip(_BODIES, (1, -1), strict=True)
        ],
        "residual_work": [_work(system, body, unloaded, axis) for body in _BODIES for axis in "xy"],
    }
    laws = [law(system, b, c) for b in _BODIES for c in (loaded, unloaded)]
    return {
        "force": abs(N.sum() - force) / force,
        **{name: max(abs(v) for v in values) / force for name, values in work.items()},
        "tension": max(0.0, -float(N.min())) / force,
        "cone": float(np.maximum(np.abs(T) - parameters.friction * N, 0.0).max()) / force,
        "overlap": max(0.0, -float(gap.min())) / travel,
        "complementarity": float(np.abs(N * gap).max()) / (force * travel),
        "left_over": max(
            float(np.abs([c.normal, c.tangential]).max()) for c in unloaded.state.contacts
        ),
        **{name: max(law[name] for law in laws) for name in laws[0]},
        "dissipation": max(0.0, -outcome.tally.plastic_work) / (force * travel),
    }


_BODIES = ("punch", "half_plane")


def _length(system: System, body: str, axis: int) -> float:
    return float(np.ptp(system.full(body).X[axis]))


def _work(system: System, body: str, converged: Converged, axis: str) -> float:
    """Return the virtual work of the affine stretch along an axis, over the body's length [N]."""
    part = system.full(body)
    stress = system.state(body, converged).stress
    along = stress[1] if axis == "y" else stress[0]
    if axis == "x" and part.body.kinematics == "axisymmetric":
        along = along + stress[2]
    return float(along @ part.weights.ravel()) / _length(system, body, "xy".index(axis))


def _hats(parameters: PunchParameters, system: System, converged: Converged) -> tuple[Array, Array]:
    """Return the mean position and the mean gap (n,) under each hat of the punch's surface."""
    sides = []
    for body, boundary in (("punch", "bottom"), ("half_plane", "top")):
        part = system.full(body)
        nodes = part.boundary_nodes(boundary)
        nodes = nodes[np.argsort(part.X[0, nodes])]
        nodes = nodes[part.X[0, nodes] <= parameters.half_width * (1 + 1e-9)]
        sides.append((part.X[0, nodes], system.displacement(body, converged.state)[2 * nodes + 1]))
    (x, above), (x_below, below) = sides
    np.testing.assert_allclose(x, x_below, atol=1e-9 * parameters.half_width)
    stride = 2 if element_type(parameters.element).quadratic else 1
    vertices = x[::stride]
    gap = above - below

    xi, weight = np.polynomial.legendre.leggauss(3)
    left, right = (1 - xi) / 2, (1 + xi) / 2
    at = np.outer(vertices[:-1], left) + np.outer(vertices[1:], right)
    value = np.outer(gap[:-stride:stride], left) + np.outer(gap[stride::stride], right)
    if stride == 2:
        bulge = gap[1::2] - (gap[:-2:2] + gap[2::2]) / 2
        value += np.outer(bulge, 1 - xi**2)
    measure = np.diff(vertices)[:, None] / 2 * weight
    if parameters.state == "axisymmetric":
        measure = measure * 2 * np.pi * at

    def under_hats(f: Array) -> Array:
        out = np.append((f * measure * left).sum(axis=1), 0.0)
        out[1:] += (f * measure * right).sum(axis=1)
        return out

    area = under_hats(np.ones_like(at))
    return under_hats(at) / area, under_hats(value) / area


def law(system: System, body: str, converged: Converged) -> dict[str, float]:
    """Return how far stress and strain at the points of a body are from its law."""
    part, state = system.full(body), system.state(body, converged)
    material, stress = part.body.material, state.stress
    plastic, accumulated = state.plastic.plastic_strain, state.plastic.accumulated
    E, nu = material.elasticity.youngs_modulus, material.elasticity.poisson_ratio
    strain = part.strain(system.displacement(body, converged.state))
    elastic = (1 + nu) / E * stress
    elastic[:3] -= nu / E * stress[:3].sum(axis=0)
    miss = strain - elastic - plastic
    out_of_plane = 0.0
    if part.body.kinematics == "plane_stress":
        miss = miss[[0, 1, 3]]  # the strain out of plane is whatever it has to be
        out_of_plane = float(np.abs(stress[2]).max()) / max(float(np.abs(stress).max()), 1e-300)
    largest = max(float(np.abs(strain).max()), float(np.abs(plastic).max()), 1e-300)
    volume = float(np.abs(plastic[:3].sum(axis=0)).max()) / largest

    excess = 0.0
    if not material.elastic:
        linear = material.linear_hardening
        assert linear is not None
        relative = stress - 2 / 3 * linear.kinematic_modulus * plastic
        relative[:3] -= relative[:3].mean(axis=0)
        mises = np.sqrt(1.5 * (relative**2).sum(axis=0))
        strength = material.yield_stress + linear.isotropic_modulus * accumulated
        excess = max(0.0, float((mises / strength).max()) - 1)
    return {
        "yield": excess,
        "law": float(np.abs(miss).max()) / largest,
        "state": max(out_of_plane, volume),
    }
