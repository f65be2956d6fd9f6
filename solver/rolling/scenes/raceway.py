"""Ball or roller rolling along a raceway, in three dimensions.

The raceway is a block, flat or with a groove, elastic-plastic in a zone under the contact, without
ends and straight along x, held at its foot. The ball or roller is an elastic half-space with the
shape of its two radii; or with ``load = "hertz"`` there is none, but the pressure of its elastic
Hertz contact with shear in proportion, which does not change while the raceway yields. Passes are
steady: in the frame of the load nothing changes. Coordinates are x along the raceway, y up from the
lowest line of the groove, z across; x = 0 is at the load. A positive ``traction`` brakes.

A.R.S. Ponter, A.D. Hearle, K.L. Johnson, J. Mech. Phys. Solids 33 (1985) 339-362.
"""

from __future__ import annotations

from solver.late import late
from solver.rolling.scenes.raceway_parameters import RacewayParameters
from solver.rolling.scenes.rail_scene import rail_scene

(_geometry,) = late("rolling.scenes.raceway_setup", "geometry")

RACEWAY = rail_scene(
    "raceway",
    "ball or roller rolling along an elastic-plastic raceway, in three dimensions",
    RacewayParameters,
    geometry=_geometry,
    outputs=(
        *late("rolling.scenes.rail_outputs", "cycles"),
        *late("rolling.scenes.raceway_setup", "elastic"),
    ),
    advice="lower load or traction, or choose another accuracy",
)
