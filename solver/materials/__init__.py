"""Material laws: (strain, state) -> (stress, tangent, new state, yielding).

`Law` is the contract. `Material` is the law of the scenes: von Mises, linear hardening. `Chaboche`
hardens along a `Curve`, such as `Voce` or `Table`, and by `BackStress`es that fade, such as
`ArmstrongFrederick`. In `Layered`, layers yield one after the other. `TrescaMaterial` yields by the
largest shear stress, `SmoothMaterial` on any `SmoothSurface`. `PlaneStress` turns any law into one
for plane stress; `Heated` lowers the stiffness and strength of any law. Both inherit from
`wrapped.Wrapped`, which takes all other members from the wrapped law.
"""

from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.chaboche import Chaboche
from solver.materials.curves import Curve, Table, Voce
from solver.materials.elasticity import Elasticity
from solver.materials.hardening import LinearHardening
from solver.materials.heated import Heated
from solver.materials.law import Law
from solver.materials.layered import Layered
from solver.materials.material import Hardening, Material
from solver.materials.plane_stress import PlaneStress
from solver.materials.smooth import SmoothMaterial
from solver.materials.smooth_surface import Profile, SmoothSurface
from solver.materials.state import PlasticState, Response
from solver.materials.tresca import TrescaMaterial
from solver.materials.yield_surface import Tresca, VonMises, YieldSurface

__all__ = [
    "ArmstrongFrederick",
    "BackStress",
    "Chaboche",
    "Curve",
    "Elasticity",
    "Hardening",
    "Heated",
    "Law",
    "Layered",
    "LinearHardening",
    "Material",
    "PlaneStress",
    "PlasticState",
    "Profile",
    "Response",
    "SmoothMaterial",
    "SmoothSurface",
    "Table",
    "Tresca",
    "TrescaMaterial",
    "Voce",
    "VonMises",
    "YieldSurface",
]
