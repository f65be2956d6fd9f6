"""Elastic punch pressed on an elastic half-plane of the same material, with friction.

The geometry is that of scene `punch`. Nothing yields, so stress at the square corner is singular:
stress ~ r^(p-1). The outputs are the power p, the part of the contact that sticks, the contact
pressure, and a map of the difference of principal stresses, whose contours are isochromatics.

A relief groove may be cut into the punch, at the height ``eta`` times its size above the contact,
and into the half-plane, its middle at the distance ``xi`` times its size from the corner. Both are
square notches, as wide as deep. With xi = 0.5 the groove begins at the corner: two quarter-planes
meet there, without a singularity. Elsewhere a groove has no part in the power of the corner itself,
which depends on its angles and friction alone, unless the corner lifts off. It takes intensity from
the corner, and raises the power that seems to be there at some distance (``apparent_power``).

The load grows in proportion, the bodies are linear and touch without a gap, so all fields grow in
proportion too: one increment is exact, friction included.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 4.4.2. The outer dimensions
and the shape of the grooves are not given there. A half-plane of 100 a makes the part that sticks
less than 0.01 a too wide, one of 40 a by 0.01 a.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from solver.errors import ModelError
from solver.loading.program import Program, load_and_release
from solver.model.model import ContactPair, Model
from solver.parameters import Accuracy, Friction, Length, Stress, by_accuracy, described
from solver.results.contact import contact
from solver.results.figures import cost
from solver.results.maps import isochromatics
from solver.results.record import Status
from solver.results.stick import stick
from solver.results.view import View
from solver.scenes.corner import corner, lifted
from solver.scenes.effort import Effort
from solver.scenes.flat_punch import (
    FACING,
    FlatPunch,
    Groove,
    GrooveDistance,
    GrooveHeight,
    GrooveSize,
    Growth,
    HalfPlaneSize,
    PunchHeight,
    SmallestElement,
)
from solver.scenes.material_parameters import ElasticParameters
from solver.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"smallest_element": 1 / 3000, "growth": 1.4},
    "standard": {"smallest_element": 1 / 9000, "growth": 1.3},
    "fine": {"smallest_element": 1 / 30000, "growth": 1.2},
}
_LARGEST = 0.01  # of a, under the punch: the end of the part that sticks is known to half of it
_MIDDLE = 0.002  # of a: with friction 0.1 only 0.02 a sticks


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticPunchParameters(ElasticParameters):
    """Parameters of the elastic punch (N, mm, MPa)."""

    mean_pressure: Stress = described(100.0, "mean pressure on the punch")
    friction: Friction = described(0.0, "Coulomb friction coefficient")
    state: Literal["plane_strain", "plane_stress"] = described(
        "plane_strain", "two-dimensional state"
    )
    half_width: Length = described(50.0, "half-width a of the punch")
    punch_height: PunchHeight = described(2.0, "height of the punch / a")
    half_plane_size: HalfPlaneSize = described(100.0, "width and depth of the half-plane / a")
    punch_groove: GrooveSize = described(
        0.0, "width and depth D of a groove in the side of the punch / a; 0 leaves it out"
    )
    eta: GrooveHeight = described(1.0, "height of the groove in the punch above the contact / D")
    half_plane_groove: GrooveSize = described(
        0.0, "width and depth D of a groove in the half-plane / a; 0 leaves it out"
    )
    xi: GrooveDistance = described(
        1.0, "distance of the middle of the groove in the half-plane from the corner / D"
    )
    smallest_element: SmallestElement = by_accuracy("smallest element side, at the corner / a")
    growth: Growth = by_accuracy("ratio of neighbouring element sides away from the corner")
    element: Literal["quad8", "quad9", "quad4", "tri6", "tri3"] = described(
        "quad8", "element of both bodies"
    )

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ElasticParameters.__post_init__(self)
        if not self.punch_groove < 1:
            raise ModelError("punch_groove", self.punch_groove, "must be less than 1")
        for name, size, end, limit in (
            ("eta", self.punch_groove, self.eta + 1, self.punch_height),
            ("xi", self.half_plane_groove, self.xi + 0.5, self.half_plane_size - 1),
        ):
            own = getattr(self, name)
            if size * end >= limit:
                most = limit / size - (end - own)
                raise ModelError(
                    name, own, f"must be less than {most:g}, for a groove inside the body"
                )
        self.geometry.check_elements(self.smallest_element)

    def usual(self) -> Mapping[str, float]:
        """Return the mesh of an accuracy."""
        return _USUAL[self.accuracy]

    @property
    def geometry(self) -> FlatPunch:
        """Dimensions and elements of punch and half-plane [mm]."""
        a = self.half_width
        above, beside = (
            Groove(distance * size * a, size * a) if size else None
            for distance, size in (
                (self.eta, self.punch_groove), (self.xi - 0.5, self.half_plane_groove)
            )
        )  # fmt: skip
        return FlatPunch(
            half_width=a,
            height=self.punch_height * a,
            size=self.half_plane_size * a,
            smallest=self.smallest_element * a,
            growth=self.growth,
            largest=_LARGEST * a,
            middle=_MIDDLE * a,
            punch_groove=above,
            half_plane_groove=beside,
        )


def model(parameters: ElasticPunchParameters) -> Model:
    """Return the half model; its pressure is 1 MPa at load factor 1."""
    geometry, material = parameters.geometry, parameters.elastic_material()
    bodies = geometry.bodies(
        punch=material,
        half_plane=material,
        kinematics=parameters.state,
        element=parameters.element,
        pressure=1.0,
    )
    pair = ContactPair(
        slave=("punch", "bottom"),
        master=("half_plane", FACING),
        friction=parameters.friction,
        sliding="small",
    )
    return Model(bodies=bodies, contacts=(pair,))


def program(parameters: ElasticPunchParameters) -> Program:
    """Return the history: the pressure is raised, then taken away with the punch."""
    return load_and_release(parameters.mean_pressure, parameters.mean_pressure, 1)


def effort(parameters: ElasticPunchParameters, pressures: Sequence[float]) -> Effort:
    """Return the work of loading up to each pressure: one increment."""
    geometry, element = parameters.geometry, parameters.element
    punch, _ = geometry.lattices(element)
    # both bodies are reduced to their contact surfaces; x is held on the line of symmetry
    nodes = punch.along + geometry.facing_nodes(element)
    return Effort(
        elements=geometry.elements(element),
        unknowns=2 * nodes - 2,
        increments=len(pressures),
        most_increments=len(pressures),
    )


def view(parameters: ElasticPunchParameters) -> View:
    """Return where the results are taken: ever closer towards the corner."""
    a = parameters.half_width
    away = np.geomspace(1e-3, 1.0, 81)
    up = away[away < parameters.punch_height]
    inside, outside = np.geomspace(5e-4, 1.0, 67), np.geomspace(5e-4, 0.98, 40)
    return View(
        x=a * np.concatenate([1.0 - away[::-1], 1.0 + away]),
        y=a * np.concatenate([-away[::-1], up]),
        depth=np.zeros(1),
        station=np.zeros(1),
        s=a * np.concatenate([1.0 - inside[::-1], [1.0], 1.0 + outside]),
        profile_body="half_plane",
        surfaces={"punch": "bottom", "half_plane": FACING},
        symmetric=True,
    )


ELASTIC_PUNCH = Scene(
    name="elastic_punch",
    summary="elastic punch pressed on an elastic half-plane with friction, relief grooves or none",
    parameters=ElasticPunchParameters,
    branch="mean_pressure",
    model=model,
    program=program,
    view=view,
    outputs=(isochromatics, contact, stick, corner),
    costs=(cost,),
    effort=effort,
    warnings=lifted,
    advice={Status.NOT_CONVERGED: "refine the mesh by smallest_element or growth"},
)
