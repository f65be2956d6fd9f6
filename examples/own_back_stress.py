"""Define a back stress that does not fade below a threshold, and check it in tension."""

from dataclasses import dataclass

import numpy as np

from solver.materials import BackStress, Elasticity
from solver.materials.hardening_rules import HARDENING, MovingRule
from solver.parameters import Stress, described
from solver.tensors import von_mises


@HARDENING.word("threshold")
@dataclass(frozen=True, kw_only=True)
class Threshold(MovingRule, BackStress):
    """dX = 2/3 C d(plastic strain) - gamma <1 - L / J(X)> X dp, with J von Mises' stress."""

    modulus: Stress = described(6e4, "C of threshold hardening")
    recall: float = described(600.0, "gamma of threshold hardening")
    threshold: Stress = described(40.0, "L of threshold hardening, below which nothing fades")
    limit = property(lambda self: self.threshold + self.modulus / self.recall)

    def parts(self, yield_stress):
        """Return the back stresses of this rule: itself."""
        return (self,)

    def in_tension(self, p):
        """Return its stress in tension [MPa], which begins to saturate at p = L / C."""
        later = np.maximum(p - self.threshold / self.modulus, 0.0)
        return self.modulus * (p - later - np.expm1(-self.recall * later) / self.recall)

    def evolve(self, old, growth, normal):
        """Return the back stress after a growth of plastic strain along a normal [MPa]."""
        grown, fade = old + 2 / 3 * self.modulus * growth * normal, self.recall * growth
        size = np.maximum(von_mises(grown), self.threshold)
        return grown * (1 + fade * self.threshold / size) / (1 + fade)


if __name__ == "__main__":
    law = Threshold().law(Elasticity(youngs_modulus=2e5, poisson_ratio=0.3), yield_stress=350.0)
    state, pull = law.initial(1, 4), np.array([[1.0], [-0.5], [-0.5], [0.0]])
    for strain in np.linspace(0.0, 0.005, 501):
        stress, _, state, _ = law.respond(strain * pull, state)
    assert np.allclose(von_mises(stress), law.strength(state), rtol=1e-3)
    print(f"stress at a strain of 0.5 %: {von_mises(stress)[0]:.1f} MPa")
