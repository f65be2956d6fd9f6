"""Ball pressed on a half-space that yields, or on a rigid plane and yielding itself.

Axisymmetric, about x = 0. The body that yields lies below: the half-space under an elastic ball, or
the ball under a rigid plane. The force is that of an elastic Hertz contact with the peak pressure
``load_ratio * yield_stress``; it acts on the far side of the ball, where a cap is left out of the
mesh. The approach is the displacement of the ball's centre.

After unloading an indented half-space keeps a crater with a pile-up around it.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 4.4.4. The diameter of the
ball is not given there. L. Kogut, I. Etsion, J. Appl. Mech. 69 (2002) 657-662; R.L. Jackson, I.
Green, J. Tribology 127 (2005) 343-354.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.loading.program import Lap, Program, Stage, walked
from solver.mesh import ball, grid
from solver.mesh.shapes import ball_lines, cap_area, fine_lines
from solver.model.body import Body
from solver.model.loads import Traction
from solver.model.model import Model
from solver.model.rigid import RigidBody, line
from solver.parameters import Accuracy, Length, by_accuracy, described
from solver.results.contact import contact
from solver.results.extremes import residual_extremes
from solver.results.figures import cost, extremes
from solver.results.indentation import crater, follow, history, indentation
from solver.results.maps import maps, profiles
from solver.results.record import Status
from solver.results.view import View
from solver.scenes.effort import Effort, lattice
from solver.scenes.material_parameters import ContactParameters
from solver.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"element_size": 1 / 12, "growth": 1.5, "load_step": 0.1},
    "standard": {"element_size": 1 / 24, "growth": 1.3, "load_step": 0.05},
    "fine": {"element_size": 1 / 48, "growth": 1.15, "load_step": 0.025},
}
_FINE = 1.3  # reach of elements of one size / expected contact radius
_PLATEAU = 2.8  # mean pressure of a contact that yields all over / yield stress


@dataclass(frozen=True, slots=True, kw_only=True)
class BallParameters(ContactParameters):
    """Parameters of the ball (N, mm, MPa)."""

    yield_stress: Annotated[float, Interval(gt=0.0, le=1e7), Unit("MPa")] = described(
        410.0, "uniaxial yield stress Re"
    )
    load_ratio: Annotated[float, Interval(gt=0.0, le=100.0), Unit("1")] = described(
        6.0, "peak pressure of the elastic Hertz contact / yield stress"
    )
    yielding: Literal["half_space", "ball"] = described(
        "half_space",
        "the body that yields: a half-space under an elastic ball, or a ball under a rigid plane",
    )
    radius: Length = described(10.0, "radius R of the ball")
    ball_stiffness: Annotated[float, Interval(ge=0.01, le=20.0), Unit("1")] = described(
        1.0, "Young's modulus of an elastic ball / that of the half-space"
    )
    half_space_size: Annotated[float, Interval(ge=5.0, le=1e4), Unit("1")] = described(
        60.0, "width and depth of the half-space / expected contact radius"
    )
    element_size: Annotated[float, Interval(ge=1e-3, le=0.5), Unit("1")] = by_accuracy(
        "element side at the contact / expected contact radius"
    )
    growth: Annotated[float, Interval(ge=1.05, le=3.0), Unit("1")] = by_accuracy(
        "ratio of neighbouring element sides away from the contact"
    )
    load_step: Annotated[float, Interval(ge=1e-4, le=1.0), Unit("1")] = by_accuracy(
        "largest increment of the load / load"
    )
    unload_steps: Annotated[int, Interval(ge=1, le=1000)] = described(5, "increments of unloading")
    cycles: Annotated[int, Interval(ge=1, le=100)] = described(1, "times the load is put on")

    def usual(self) -> Mapping[str, float]:
        """Return the mesh and the increments of an accuracy."""
        return _USUAL[self.accuracy]

    @property
    def contact_modulus(self) -> float:
        """E* of both bodies [MPa]."""
        half = (1 - self.poisson_ratio**2) / self.youngs_modulus
        return 1 / (half if self.yielding == "ball" else half + half / self.ball_stiffness)

    @property
    def force(self) -> float:
        """Force of the elastic Hertz contact, pi^3 R^2 p0^3 / (6 E*^2) [N]."""
        peak = self.load_ratio * self.yield_stress
        return math.pi**3 * self.radius**2 * peak**3 / (6 * self.contact_modulus**2)

    @property
    def hertz_radius(self) -> float:
        """Contact radius a = pi p0 R / (2 E*) of the elastic Hertz contact [mm]."""
        peak = self.load_ratio * self.yield_stress
        return math.pi * peak * self.radius / (2 * self.contact_modulus)

    @property
    def expected_radius(self) -> float:
        """Contact radius that the mesh is made for: elastic, or yielding all over [mm]."""
        plastic = math.sqrt(self.force / (math.pi * _PLATEAU * self.yield_stress))
        return max(self.hertz_radius, plastic)

    @property
    def sides(self) -> tuple[float, float, float]:
        """Reach of the fine elements, their side [mm], and how they grow."""
        a = self.expected_radius
        return _FINE * a, self.element_size * a, self.growth


def _ball(p: BallParameters, *, above: bool) -> Body:
    fine, side, growth = p.sides
    push = (-1 if above else 1) * p.force / cap_area(p.radius)
    return Body(
        name="ball",
        mesh=ball(p.radius, size=side, fine=fine, growth=growth, above=above, symmetric=True),
        material=p.material(p.ball_stiffness, elastic=True) if above else p.material(),
        kinematics="axisymmetric",
        supports={"left": "x"},
        loads=tuple(Traction(boundary=name, y=push) for name in ("cap", "right")),
    )


def model(parameters: BallParameters) -> Model:
    """Return the ball, and what it is pressed on."""
    p = parameters
    if p.yielding == "ball":
        plane = RigidBody(name="plane", surfaces={"base": line((0.0, 0.0), (p.radius, 0.0))})
        pair = p.contact(slave=("ball", "surface"), master=("plane", "base"), sliding="finite")
        return Model(bodies=(_ball(p, above=False),), rigid=(plane,), contacts=(pair,))
    lines = _half_space_lines(p)
    half_space = Body(
        name="half_space",
        mesh=grid(lines, -lines[::-1]),
        material=p.material(),
        kinematics="axisymmetric",
        supports={"left": "x", "bottom": "y"},
    )
    pair = p.contact(slave=("half_space", "top"), master=("ball", "surface"), sliding="finite")
    return Model(bodies=(_ball(p, above=True), half_space), contacts=(pair,))


def _half_space_lines(p: BallParameters) -> NDArray[np.float64]:
    return fine_lines(p.half_space_size * p.expected_radius, *p.sides)


def program(parameters: BallParameters) -> Program:
    """Return the history: the force is raised and taken away, as many times as asked."""
    stages = (
        Stage(name="loaded", target=1.0, step=parameters.load_step),
        Stage(name="unloaded", target=0.0, steps=parameters.unload_steps, apart=True, turns=True),
    )
    return Program(laps=(Lap(stages),) * parameters.cycles)


def effort(parameters: BallParameters, cycles: Sequence[float]) -> Effort:
    """Return the work of the largest number of cycles."""
    p = parameters
    bent = len(ball_lines(p.radius, *p.sides)) - 1
    own = lattice(bent, bent, "quad8")
    increments = walked([program(p)]) // p.cycles * round(max(cycles))
    if p.yielding == "ball":
        elements, unknowns = own.elements, 2 * own.nodes - own.up
    else:
        flat = len(_half_space_lines(p)) - 1
        below = lattice(flat, flat, "quad8")
        elements = own.elements + below.elements
        # the ball is reduced to its surface; x is held on the axis
        unknowns = 2 * own.along - 1 + 2 * below.nodes - below.up - below.along
    return Effort(
        elements=elements, unknowns=unknowns, increments=increments, most_increments=increments
    )


def view(parameters: BallParameters) -> View:
    """Return where the results are taken, around the contact."""
    a = parameters.expected_radius
    body = parameters.yielding
    return View(
        x=a * (np.arange(120) + 0.5) / 40,
        y=-a * (np.arange(120) + 0.5) / 40,
        depth=np.concatenate([[0.0], a * np.geomspace(0.01, 5.0, 80)]),
        station=a * np.array([0.0, 0.5, 1.0]),
        s=a * np.concatenate([np.linspace(0.0, 2.0, 161), np.linspace(2.05, 5.0, 60)]),
        profile_body=body,
        surfaces={body: "surface" if body == "ball" else "top"},
        symmetric=True,
    )


BALL = Scene(
    name="ball",
    summary="ball pressed on a half-space that yields, or yielding under a rigid plane",
    parameters=BallParameters,
    branch="cycles",
    model=model,
    program=program,
    view=view,
    outputs=(maps, profiles, contact, extremes, residual_extremes, indentation, crater, history),
    costs=(cost,),
    watch=follow,
    effort=effort,
    advice={
        Status.NOT_CONVERGED: "reduce load_step, or make element_size smaller",
        Status.LIMIT_LOAD: "lower load_ratio, or let the material harden",
    },
)
