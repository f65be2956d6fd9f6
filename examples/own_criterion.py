"""A fatigue criterion of your own: McDiarmid's, without its two cases of cracks."""

from dataclasses import dataclass

import numpy as np

from solver.fatigue import CRITERIA, Paths, PlaneCriterion
from solver.parameters import Stress, described


@CRITERIA.word("mcdiarmid")
@dataclass(frozen=True, slots=True, kw_only=True)
class McDiarmid(PlaneCriterion):
    """tau_a + t sigma_n,max / (2 sigma_u) <= t, on the plane where this is largest."""

    torsion: Stress = described(300.0, "fatigue limit in fully reversed torsion")
    tensile_strength: Stress = described(900.0, "tensile strength sigma_u")

    @property
    def limit(self):
        """The limit in torsion [MPa]."""
        return self.torsion

    def on_plane(self, on):
        """Return the equivalent shear amplitude of what acts on planes."""
        return on.shear + self.torsion * on.normal / (2 * self.tensile_strength)


if __name__ == "__main__":
    t = np.linspace(0.0, 2 * np.pi, 37)
    stress = np.zeros((2, 37, 6))  # two points: torsion alone, then with steady tension
    stress[:, :, 3], stress[1, :, 0] = 200 * np.sin(t), 150.0
    found = McDiarmid().assess(Paths(stress))
    print("safety factors", found.safety_factor.round(3), "planes", found.plane.round(2))
    ratio = 300 / 1800  # closed form of torsion: the worst plane is turned by arctan(ratio) / 2
    assert abs(found.value[0] / (200 * np.hypot(1, ratio)) - 1) < 1e-10
    assert found.safety_factor[1] < found.safety_factor[0], "tension opens the plane"
