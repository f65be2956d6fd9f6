"""Define a yield surface, Hosford's, between von Mises and Tresca, and check it in pure shear.

With RESIDUA_PARTS=own_yield_surface.py studies and scene files can use it:
yield_condition = "hosford".
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver.materials import Elasticity
from solver.materials.hardening_rules import NoHardening
from solver.materials.yield_conditions import YIELD_CONDITIONS, SmoothCondition
from solver.parameters import described


@YIELD_CONDITIONS.word("hosford")
@dataclass(frozen=True, slots=True, kw_only=True)
class Hosford(SmoothCondition):
    """Yield by the mean of powers of the differences of principal stresses."""

    hosford_exponent: Annotated[float, Interval(ge=2.0, le=100.0), Unit("1")] = described(
        8.0, "exponent of the hosford condition: 2 is mises, a large exponent is close to tresca"
    )

    def tension(self, s):
        """Return the equivalent tensile stress of principal stresses s[0] >= s[1] >= s[2]."""
        a = self.hosford_exponent
        return (((s[0] - s[1]) ** a + (s[1] - s[2]) ** a + (s[0] - s[2]) ** a) / 2) ** (1 / a)


if __name__ == "__main__":
    elasticity, hosford = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3), Hosford()
    law = hosford.law(elasticity, 350.0, NoHardening())
    sheared = np.array([[0.0], [0.0], [0.0], [0.01]])
    shear = law.respond(sheared, law.initial(1, 4)).stress[3, 0] / np.sqrt(2)
    assert np.isclose(shear, 350.0 * (2 / (2 + 2**8)) ** (1 / 8), rtol=1e-12)
    print(f"yield in pure shear: {shear:.1f} MPa")
