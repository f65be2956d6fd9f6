"""Material laws: (strain, state) -> (stress, tangent, new state, yielding).

`Law` is the contract. `Material` is the law of the package, made of `Elasticity`, a `VonMises`
surface and `LinearHardening`; `PlaneStress` makes any law one for plane stress.
"""

from solver.materials.elasticity import Elasticity
from solver.materials.hardening import LinearHardening
from solver.materials.law import Law
from solver.materials.material import Hardening, Material
from solver.materials.plane_stress import PlaneStress
from solver.materials.state import PlasticState, Response
from solver.materials.yield_surface import VonMises, YieldSurface

__all__ = [
    "Elasticity",
    "Hardening",
    "Law",
    "LinearHardening",
    "Material",
    "PlaneStress",
    "PlasticState",
    "Response",
    "VonMises",
    "YieldSurface",
]
