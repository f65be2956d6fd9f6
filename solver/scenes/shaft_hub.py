"""Hub on a longer shaft, pressed by a pressure outside or by an interference fit.

The bodies are elastic and axisymmetric, x is the radius; the lower half is computed, below the
middle of the hub at y = 0. The meridian is that of a punch on a half-plane, turned: the edge of the
bore is a square corner, where stress is singular, ~ r^(p-1). Under a pressure
outside the hub slips outward, as a punch does, and friction lowers p. In an interference fit it
slips inward, and friction raises p.

A relief groove may be cut into the side face of the hub, ``eta`` times its size outside the
contact, and into the shaft, its middle ``xi`` times its size beside the edge. Both are square
notches. With xi = 0.5 the groove begins at the edge, where two right angles meet: there is no
singularity.

The load grows in proportion, the bodies are linear and touch without a gap, so all fields grow in
proportion too: one increment is exact, friction included.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 4.4.3. The dimensions and the
shape of the grooves are not given there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.loading.program import Program, load_and_release
from solver.model.body import Body
from solver.model.model import ContactPair, Model
from solver.parameters import Accuracy, Friction, Length, Stress, by_accuracy, described
from solver.results.contact import contact
from solver.results.figures import cost
from solver.results.maps import isochromatics
from solver.results.quantities import declare
from solver.results.record import Status
from solver.results.run import FinishedRun, Values
from solver.results.stick import stick
from solver.results.view import Axis, View
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
    SmallestElement,
)
from solver.scenes.material_parameters import ElasticParameters
from solver.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from skfem import Mesh

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"smallest_element": 1 / 3000, "growth": 1.4},
    "standard": {"smallest_element": 1 / 9000, "growth": 1.3},
    "fine": {"smallest_element": 1 / 30000, "growth": 1.2},
}
_LARGEST = 0.02  # of a, along the contact: the end of the part that sticks is known to half of it
_MIDDLE = 0.004  # of a

HOOP_STRESS = declare(
    "hoop_stress", "hoop stress of hub and shaft along the contact under load", "MPa",
    dims=("body", "s"),
)  # fmt: skip

Ratio = Annotated[float, Interval(ge=1.05, le=20.0), Unit("1")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShaftHubParameters(ElasticParameters):
    """Parameters of shaft and hub (N, mm, MPa)."""

    mean_pressure: Stress = described(
        100.0, "contact pressure of a hub on a shaft of its own length, after Lame"
    )
    loading: Literal["pressure", "interference"] = described(
        "interference", "what presses the hub on the shaft: a pressure around it, or the fit"
    )
    friction: Friction = described(0.0, "Coulomb friction coefficient")
    half_width: Length = described(50.0, "half the length of the hub, a")
    shaft_radius: Annotated[float, Interval(ge=0.05, le=20.0), Unit("1")] = described(
        1.0, "radius R of the shaft / a"
    )
    hub_radius: Ratio = described(2.5, "outer radius of the hub / R")
    shaft_length: Ratio = described(4.0, "length of the shaft / length of the hub")
    hub_groove: GrooveSize = described(
        0.0, "width and depth D of a groove in the side face of the hub / a; 0 leaves it out"
    )
    eta: GrooveHeight = described(1.0, "distance of the groove in the hub from the bore / D")
    shaft_groove: GrooveSize = described(
        0.0, "width and depth D of a groove in the shaft / a; 0 leaves it out"
    )
    xi: GrooveDistance = described(
        1.0, "distance of the middle of the groove in the shaft from the edge of the hub / D"
    )
    smallest_element: SmallestElement = by_accuracy("smallest element side, at the edge / a")
    growth: Growth = by_accuracy("ratio of neighbouring element sides away from the edge")

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ElasticParameters.__post_init__(self)
        height, depth = self.shaft_radius * (self.hub_radius - 1), self.shaft_radius
        for name, size, most in (
            ("hub_groove", self.hub_groove, 1.0),
            ("shaft_groove", self.shaft_groove, depth),
        ):
            if not size < most:
                raise ModelError(name, size, f"must be less than {most:g}")
        for name, size, end, limit in (
            ("eta", self.hub_groove, self.eta + 1, height),
            ("xi", self.shaft_groove, self.xi + 0.5, self.shaft_length - 1),
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
    def radius(self) -> float:
        """Radius R of the shaft [mm]."""
        return self.shaft_radius * self.half_width

    @property
    def interference(self) -> float:
        """Difference of radii that makes the mean pressure, with equal lengths after Lame [mm]."""
        outer = self.hub_radius**2
        return 2 * self.mean_pressure * self.radius * outer / (self.youngs_modulus * (outer - 1))

    @property
    def geometry(self) -> FlatPunch:
        """Dimensions and elements [mm]; the hub is the punch, the shaft the half-plane."""
        a = self.half_width
        outside, beside = (
            Groove(distance * size * a, size * a) if size else None
            for distance, size in ((self.eta, self.hub_groove), (self.xi - 0.5, self.shaft_groove))
        )
        return FlatPunch(
            half_width=a,
            height=self.radius * (self.hub_radius - 1),
            size=self.shaft_length * a,
            depth=self.radius,
            smallest=self.smallest_element * a,
            growth=self.growth,
            largest=_LARGEST * a,
            middle=_MIDDLE * a,
            punch_groove=outside,
            half_plane_groove=beside,
        )

    @property
    def axis(self) -> Axis:
        """The line of contact: down the shaft, which lies on the right of it."""
        return Axis(origin=(self.radius, 0.0), along=(0.0, -1.0))


def _turned(mesh: Mesh, parameters: ShaftHubParameters) -> Mesh:
    """Return a mesh of a punch or half-plane as that of a hub or shaft; boundaries keep names."""
    x, y = mesh.doflocs
    radius = parameters.radius + y
    radius = np.maximum(radius, 0.0)  # rounding must not cross the axis
    return replace(mesh, doflocs=np.stack([radius, -x]))


def model(parameters: ShaftHubParameters) -> Model:
    """Return the lower half; load factor 1 makes a mean pressure of 1 MPa."""
    fitted = parameters.loading == "interference"
    material = parameters.elastic_material()
    hub, shaft = (_turned(mesh, parameters) for mesh in parameters.geometry.meshes("quadrilateral"))
    bodies = (
        Body(
            name="hub",
            mesh=hub,
            material=material,
            kinematics="axisymmetric",
            supports={"left": "y"},
            pressure={} if fitted else {"top": 1.0},
        ),
        Body(
            name="shaft",
            mesh=shaft,
            material=material,
            kinematics="axisymmetric",
            supports={"left": "y", "bottom": "x"},
        ),
    )
    pair = ContactPair(
        slave=("hub", "bottom"),
        master=("shaft", FACING),
        friction=parameters.friction,
        sliding="small",
        interference=parameters.interference / parameters.mean_pressure if fitted else 0.0,
    )
    return Model(bodies=bodies, contacts=(pair,))


def program(parameters: ShaftHubParameters) -> Program:
    """Return the history: the load is raised, then taken away and the hub with it."""
    return load_and_release(parameters.mean_pressure, parameters.mean_pressure, 1)


def effort(parameters: ShaftHubParameters, pressures: Sequence[float]) -> Effort:
    """Return the work of loading up to each pressure: one increment."""
    geometry = parameters.geometry
    hub, _ = geometry.lattices("quad8")
    # both bodies are reduced to their contact surfaces; y is held in the middle
    nodes = hub.along + geometry.facing_nodes("quad8")
    return Effort(
        elements=geometry.elements("quad8"),
        unknowns=2 * nodes - 2,
        increments=len(pressures),
        most_increments=len(pressures),
    )


def view(parameters: ShaftHubParameters) -> View:
    """Return where the results are taken: ever closer towards the edge.

    Positions are along the contact, from the middle of the hub down, and outside it.
    """
    a = parameters.half_width
    away = np.geomspace(1e-3, 1.0, 81)
    deep = away[away < parameters.shaft_radius]
    out = away[away < parameters.shaft_radius * (parameters.hub_radius - 1)]
    beside = away[away < parameters.shaft_length - 1]
    inside, outside = np.geomspace(5e-4, 1.0, 67), np.geomspace(5e-4, 1.0, 40)
    outside = outside[outside < parameters.shaft_length - 1]
    return View(
        x=a * np.concatenate([1.0 - away[::-1], 1.0 + beside]),
        y=a * np.concatenate([-deep[::-1], out]),
        depth=np.zeros(1),
        station=np.zeros(1),
        s=a * np.concatenate([1.0 - inside[::-1], [1.0], 1.0 + outside]),
        profile_body="shaft",
        surfaces={"hub": "bottom", "shaft": FACING},
        symmetric=True,
        axis=parameters.axis,
    )


def hoop(run: FinishedRun) -> Values:
    """Return the hoop stress along the contact, on either side of it."""
    sides = [run.samples.on_surface("stress", body, run.loaded)[2] for body in run.view.surfaces]
    return {HOOP_STRESS: np.stack(sides)}


SHAFT_HUB = Scene(
    name="shaft_hub",
    summary="hub on a longer shaft, under a pressure around it or by an interference fit",
    parameters=ShaftHubParameters,
    branch="mean_pressure",
    model=model,
    program=program,
    view=view,
    outputs=(isochromatics, contact, stick, corner, hoop),
    costs=(cost,),
    effort=effort,
    warnings=lifted,
    advice={Status.NOT_CONVERGED: "refine the mesh by smallest_element or growth"},
)
