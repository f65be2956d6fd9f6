"""Define a material law with a yield stress that saturates, after Voce.

    flow stress R(p) = Y + Q (1 - exp(-b p))

The package has it too, as a curve of `Chaboche`. Written out here it shows what a law must define
(`solver.materials.Law`): its elasticity, its flow stress, and its response to a strain. All else
(yield value, plane stress, strength in shear, checks of the audit) follows from these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver import Body, Model, PathControl, solve
from solver.materials import Elasticity, Law, PlasticState, Response
from solver.mesh import grid
from solver.tensors import identity


@dataclass(frozen=True, kw_only=True)
class Saturating(Law):
    """Von Mises plasticity with isotropic hardening that saturates.

    ``yield_stress`` is Y and ``growth`` is Q [MPa]; ``rate`` is b. There is a limit load, so
    `hardens` stays False, the default of `Law`.
    """

    elasticity: Elasticity
    yield_stress: float
    growth: float
    rate: float

    def curve(self, p):
        """Return the flow stress R at an equivalent plastic strain [MPa]."""
        return self.yield_stress + self.growth * (1 - np.exp(-self.rate * p))

    def slope(self, p):
        """Return dR/dp [MPa]."""
        return self.growth * self.rate * np.exp(-self.rate * p)

    def flow_stress(self, state: PlasticState) -> np.ndarray:
        """Return the size of the yield surface at the points [MPa]."""
        return self.curve(state.accumulated)

    def respond(self, strain: np.ndarray, state: PlasticState) -> Response:
        """Return stress, tangent and new state: the radial return with a curved R(p).

        1. trial stress with the plastic strain frozen, its von Mises stress q
        2. solve q - 3 G dp = R(p + dp). Left side minus right side is convex and falls, so Newton's
           iteration from dp = 0 approaches the root from the left without a safeguard
        3. plastic strain += dp N, with N = 3/2 s / q, and stress -= 2 G dp N
        """
        G, C = self.elasticity.shear_modulus, self.stiffness(len(strain))
        trial = C @ (strain - state.plastic_strain)
        yielding = self.yield_value(trial, state) > 0
        q, N = self.surface.equivalent(trial), self.surface.normal(trial)

        dp = np.zeros_like(q)
        for _ in range(50):
            p = state.accumulated + dp
            miss = np.where(yielding, q - 3 * G * dp - self.curve(p), 0.0)
            if np.abs(miss).max(initial=0.0) < 1e-12 * self.yield_stress:
                break
            dp += miss / (3 * G + self.slope(p))

        # the derivative of stress by strain: N turns with the trial stress, dp grows with q
        one = identity(len(strain))
        deviatoric = np.eye(len(strain)) - np.outer(one, one) / 3
        turning = np.where(yielding, 3 * G * dp / np.where(yielding, q, 1.0), 0.0)
        growing = np.where(yielding, 3 * G / (3 * G + self.slope(p)), 0.0) - turning
        tangent = C[:, :, None] - 2 * G * (
            turning * deviatoric[:, :, None] + growing * 2 / 3 * N[:, None] * N[None]
        )
        after = replace(
            state,
            plastic_strain=state.plastic_strain + dp * N,
            accumulated=state.accumulated + dp,
        )
        return Response(trial - 2 * G * dp * N, tangent, after, yielding)


steel = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
law = Saturating(elasticity=steel, yield_stress=300.0, growth=150.0, rate=40.0)
LENGTH, TENSION = 10.0, 400.0

# A bar is loaded to a tension of 400 MPa and unloaded. In plane stress and in a round bar stress is
# uniaxial, and the strain is known: TENSION / E plus the plastic strain at which R(p) = TENSION.
plastic = -np.log(1 - (TENSION - law.yield_stress) / law.growth) / law.rate
total = TENSION / steel.youngs_modulus + plastic

for kinematics in ("plane_stress", "axisymmetric", "plane_strain"):
    bar = Body(
        name="bar",
        mesh=grid(np.linspace(0, 2, 3), np.linspace(0, LENGTH, 5)),
        material=law,
        kinematics=kinematics,
        supports={"bottom": "y", "left": "x"},
        pressure={"top": -TENSION},
    )
    solution = solve(Model(bodies=(bar,)), control=PathControl(load_step=0.2))
    audit = solution.audit()
    assert audit.passed, audit.violations
    kept = solution.plastic_strain("bar")
    xx, yy, zz, xy = solution.stress("bar", "loaded")
    if kinematics == "plane_strain":  # the bar cannot contract along z, and is stronger
        assert np.all(zz > 100.0)
        assert kept.max() < plastic
    else:
        stretch = solution.displacement("bar", "loaded")[1].max() / LENGTH
        left = solution.displacement("bar", "unloaded")[1].max() / LENGTH
        assert np.allclose([stretch, left], [total, plastic], rtol=1e-9)
        assert np.allclose(kept, plastic, rtol=1e-9)
    mises = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)
    assert np.allclose(mises, law.curve(kept), rtol=1e-9)
    print(f"{kinematics}: von Mises {mises.mean():.2f} MPa, plastic strain {kept.mean():.5f}")
