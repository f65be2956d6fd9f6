"""Define a hardening curve, Swift's law k (e0 + p)^n, and check it with a bar in tension."""

from dataclasses import dataclass

import numpy as np

from solver import Body, Displacement, Model, solve
from solver.materials import Chaboche, Elasticity
from solver.materials.hardening_rules import HARDENING, GrowingRule
from solver.mesh import grid
from solver.parameters import described


@dataclass(frozen=True)
class Swift:
    """Size of the yield surface k (e0 + p)^n [MPa] at the accumulated plastic strain p."""

    k: float
    e0: float
    n: float
    limit = np.inf  # it grows without bound

    def flow_stress(self, p):
        """Return the size of the yield surface [MPa]."""
        return self.k * (self.e0 + p) ** self.n

    def slope(self, p):
        """Return its derivative by the plastic strain [MPa]."""
        return self.n * self.k * (self.e0 + p) ** (self.n - 1)


@HARDENING.word("swift")
@dataclass(frozen=True, kw_only=True)
class SwiftHardening(GrowingRule):
    """Swift's law under a word, with parameters, for studies and scene files."""

    swift_strain: float = described(0.002, "e0 of swift hardening")
    swift_exponent: float = described(0.2, "n of swift hardening")

    def flow_curve(self, elasticity, yield_stress):
        """Return the curve that begins at the yield stress."""
        k = yield_stress / self.swift_strain**self.swift_exponent
        return Swift(k, self.swift_strain, self.swift_exponent)


if __name__ == "__main__":
    E, curve = 2e5, Swift(k=900.0, e0=0.002, n=0.2)
    law = Chaboche(elasticity=Elasticity(youngs_modulus=E, poisson_ratio=0.3), curve=curve)
    bar = Body(
        name="bar", mesh=grid(np.linspace(0, 10, 3), np.linspace(0, 2, 2)), material=law,
        kinematics="plane_stress", supports={"left": "x", "bottom": "y"},
        loads=(Displacement(boundary="right", x=0.2),),
    )  # fmt: skip
    stress = solve(Model(bodies=(bar,))).stress("bar", "loaded")[0]
    plastic = 0.2 / 10 - stress / E  # strain of 2 % less its elastic part
    assert np.allclose(stress, curve.flow_stress(plastic), rtol=1e-9), stress
    print(f"stress at a strain of 2 %: {stress[0]:.2f} MPa")
