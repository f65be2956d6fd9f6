"""Rigid flat punch pressed on an elastic half-plane, with friction or without.

Without friction the pressure has a closed form, p(x) / p0 = 2 / (pi sqrt(1 - (x/a)^2)) with p0 the
mean pressure, so that this scene tells how accurate a mesh is at a singular corner. With friction
the middle of the contact sticks; the outer part of the surface slips outward... under the punch.

The load grows in proportion, the half-plane is linear and touches without a gap, so all fields
grow in proportion too: one increment is exact, friction included. The error of a finite half-plane
is inversely proportional to its size.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 4.4.1; K.L. Johnson, Contact
Mechanics (1985), section 2.8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver.loading.program import Program, load_and_release
from solver.mesh import grid
from solver.model.body import Body
from solver.model.model import ContactPair, Model
from solver.model.rigid import Pushed, RigidBody, RigidSurface
from solver.parameters import Accuracy, Friction, Length, Stress, by_accuracy, described
from solver.results.contact import contact
from solver.results.figures import cost
from solver.results.maps import isochromatics
from solver.results.quantities import declare
from solver.results.record import Status
from solver.results.run import FinishedRun, Values
from solver.results.stick import stick
from solver.results.view import View
from solver.scenes.corner import corner
from solver.scenes.effort import Effort
from solver.scenes.flat_punch import FlatPunch, Growth, HalfPlaneSize, SmallestElement
from solver.scenes.material_parameters import ElasticParameters
from solver.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"smallest_element": 1 / 4500, "growth": 1.44, "largest_element": 0.01},
    "standard": {"smallest_element": 1 / 9000, "growth": 1.2, "largest_element": 0.005},
    "fine": {"smallest_element": 1 / 18000, "growth": 1.15, "largest_element": 0.0035},
}
_MIDDLE = 0.2  # of the largest element: with friction 0.1 only 0.04 a sticks
_AWAY = 0.9  # of a: where the error of pressure is taken

PRESSURE_ERROR = declare(
    "pressure_error",
    "error of contact pressure without friction against the closed form, over nine tenths of the "
    "contact, / the pressure there; both in the mean square",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidPunchParameters(ElasticParameters):
    """Parameters of the rigid punch (N, mm, MPa)."""

    mean_pressure: Stress = described(100.0, "mean pressure under the punch")
    friction: Friction = described(0.0, "Coulomb friction coefficient")
    half_width: Length = described(50.0, "half-width a of the punch")
    half_plane_size: HalfPlaneSize = described(400.0, "width and depth of the half-plane / a")
    smallest_element: SmallestElement = by_accuracy("smallest element side, at the corner / a")
    growth: Growth = by_accuracy("ratio of neighbouring element sides away from the corner")
    largest_element: Annotated[float, Interval(ge=1e-4, le=0.1), Unit("1")] = by_accuracy(
        "largest element side under the punch / a; the part that sticks is known to half of it"
    )

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ElasticParameters.__post_init__(self)
        self.geometry.check_elements(self.smallest_element)

    def usual(self) -> Mapping[str, float]:
        """Return the mesh of an accuracy."""
        return _USUAL[self.accuracy]

    @property
    def geometry(self) -> FlatPunch:
        """Dimensions and elements of the half-plane [mm]; the punch itself has none."""
        a = self.half_width
        return FlatPunch(
            half_width=a,
            height=a,
            size=self.half_plane_size * a,
            smallest=self.smallest_element * a,
            growth=self.growth,
            largest=self.largest_element * a,
            middle=_MIDDLE * self.largest_element * a,
        )


def model(parameters: RigidPunchParameters) -> Model:
    """Return the half model; its mean pressure is 1 MPa at load factor 1."""
    under, beyond, _, down = parameters.geometry.lines
    half_plane = Body(
        name="half_plane",
        mesh=grid(np.concatenate([under, beyond[1:]]), down),
        material=parameters.elastic_material(),
        supports={"left": "x", "bottom": "y"},
    )
    # the punch is the slave, as it ends at a corner; its points are those of the half-plane
    base = RigidSurface(points=np.stack([under, np.zeros_like(under)]))
    punch = RigidBody(name="punch", surfaces={"base": base}, y=Pushed(value=-parameters.half_width))
    pair = ContactPair(
        slave=("punch", "base"),
        master=("half_plane", "top"),
        friction=parameters.friction,
        sliding="small",
    )
    return Model(bodies=(half_plane,), rigid=(punch,), contacts=(pair,))


def program(parameters: RigidPunchParameters) -> Program:
    """Return the history: the force is raised, then taken away with the punch."""
    return load_and_release(parameters.mean_pressure, parameters.mean_pressure, 1)


def effort(parameters: RigidPunchParameters, pressures: Sequence[float]) -> Effort:
    """Return the work of loading up to each pressure: one increment."""
    _, plane = parameters.geometry.lattices("quad8")
    # the half-plane is reduced to its surface; x is held on the line of symmetry
    return Effort(
        elements=plane.elements,
        unknowns=2 * plane.along,
        increments=len(pressures),
        most_increments=len(pressures),
    )


def view(parameters: RigidPunchParameters) -> View:
    """Return where the results are taken: ever closer towards the corner."""
    a = parameters.half_width
    away, near = np.geomspace(1e-3, 1.0, 81), np.geomspace(5e-4, 1.0, 67)
    return View(
        x=a * np.concatenate([1.0 - away[::-1], 1.0 + away]),
        y=-a * away[::-1],
        depth=np.zeros(1),
        station=np.zeros(1),
        s=a * np.concatenate([1.0 - near[::-1], [1.0], 1.0 + near[:-1]]),
        profile_body="half_plane",
        surfaces={"half_plane": "top"},
        symmetric=True,
    )


def pressure_error(run: FinishedRun) -> Values:
    """Return the error of the pressure away from the corner; NaN with friction."""
    parameters, points = run.parameters, run.tractions.points(run.loaded)
    assert points is not None, "the model has a contact pair"
    x = points.s / parameters.half_width
    exact = 2 / (np.pi * np.sqrt(1 - np.minimum(x, _AWAY) ** 2))
    miss = points.pressure / parameters.mean_pressure - exact
    at = x <= _AWAY
    square = [np.trapezoid(each[at] ** 2, x[at]) for each in (miss, exact)]
    error = float(np.sqrt(square[0] / square[1]))
    return {PRESSURE_ERROR: np.nan if parameters.friction else error}


RIGID_PUNCH = Scene(
    name="rigid_punch",
    summary="rigid flat punch pressed on an elastic half-plane, with friction or without",
    parameters=RigidPunchParameters,
    branch="mean_pressure",
    model=model,
    program=program,
    view=view,
    outputs=(isochromatics, contact, stick, corner, pressure_error),
    costs=(cost,),
    effort=effort,
    advice={Status.NOT_CONVERGED: "refine the mesh by smallest_element or growth"},
)
