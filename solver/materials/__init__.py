"""Material laws: (strain, state) -> (stress, tangent, new state, yielding).

`Law` is the contract. `ElasticPlastic` is the law of parts: elasticity, yield surface, hardening
curve and back stresses decide how it responds. Its forms declare the parts: `Chaboche` a `Curve`,
such as `Voce` or `Table`, and `BackStress`es, such as `ArmstrongFrederick`; `Material` linear
hardening by numbers; `TrescaMaterial` and `SmoothMaterial` another yield surface. In `Layered`,
layers yield one after the other. `PlaneStress` turns any law into one for plane stress; `Heated`
lowers the stiffness and strength of any law. Both inherit from `law.Wrapped`, which takes all other
members from the wrapped law.
"""

from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.curves import Curve, Power, Table, Voce
from solver.materials.elastic_plastic import (
    Chaboche,
    ElasticPlastic,
    Hardening,
    Material,
    SmoothMaterial,
    TrescaMaterial,
)
from solver.materials.elasticity import Elasticity
from solver.materials.heated import Heated
from solver.materials.law import Law
from solver.materials.layered import Layered
from solver.materials.plane_stress import PlaneStress
from solver.materials.radial_return import LinearHardening
from solver.materials.smooth_surface import Profile, SmoothSurface
from solver.materials.state import PlasticState, Response
from solver.materials.yield_surface import Tresca, VonMises, YieldSurface

__all__ = [
    "ArmstrongFrederick",
    "BackStress",
    "Chaboche",
    "Curve",
    "ElasticPlastic",
    "Elasticity",
    "Hardening",
    "Heated",
    "Law",
    "Layered",
    "LinearHardening",
    "Material",
    "PlaneStress",
    "PlasticState",
    "Power",
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
