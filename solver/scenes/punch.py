"""Elastic-plastic punch pressed on an elastic-plastic half-plane, and released.

A square-cornered punch of half-width a and a half-plane of the same material, symmetric about
x = 0, so that half of it is meshed. Uniform pressure on top of the punch is raised to
``load_ratio * yield_stress`` and removed. The punch is held by contact alone.

The outer dimensions are not given in the source; they are parameters here. The error of a finite
half-plane is inversely proportional to its size: with 40 a, residual tension is less than 1 % and
plastic work less than 2 % too small.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 5.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.loading.program import Program, load_and_release, walked
from solver.mesh import grid, refined
from solver.mesh.lines import cells
from solver.model.body import Body
from solver.model.model import Model
from solver.model.singular import SingularPoint
from solver.parameters import Accuracy, Length, Ratio, by_accuracy, described
from solver.results.contact import contact
from solver.results.extremes import residual_extremes
from solver.results.figures import cost, extremes
from solver.results.maps import maps, profiles, surfaces
from solver.results.quantities import Quantity, declare
from solver.results.record import Status
from solver.results.run import FinishedRun, Values
from solver.results.view import View
from solver.scenes.effort import Effort, GridSize, grid_size
from solver.scenes.material_parameters import ContactParameters
from solver.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"smallest_element": 5e-3, "growth": 1.6, "load_step": 0.1},
    "standard": {"smallest_element": 5e-4, "growth": 1.4, "load_step": 0.05},
    "fine": {"smallest_element": 1e-4, "growth": 1.2, "load_step": 0.025},
}
"""Parameters of each accuracy; docs/accuracy.md has their errors."""
_LARGEST, _PUNCH_LARGEST = 0.08, 0.25
"""Ratios of the largest element side to a: along the contact, and along the height of the punch."""
_MOST_ELEMENTS = 60_000
_NEAREST = 0.005
"""Ratio of the distance from the corner of the first published number to a."""
_DIAGONAL = 1.5
"""Ratio of the diagonal of an element at the corner to its side, sqrt(2) rounded up."""


class Lines(NamedTuple):
    """Grid lines [mm]: x under the punch and beyond it, y of the punch and of the half-plane."""

    under: NDArray[np.float64]
    beyond: NDArray[np.float64]
    up: NDArray[np.float64]
    down: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PunchParameters(ContactParameters):
    """Parameters of the punch (N, mm, MPa)."""

    load_ratio: Ratio = described(
        0.5714, "ratio of the mean pressure on the punch to the yield stress"
    )
    state: Literal["plane_stress", "plane_strain", "axisymmetric"] = described(
        "plane_stress", "two-dimensional state; axisymmetric is a flat-ended cylinder"
    )
    half_width: Length = described(50.0, "half-width a of the punch")
    punch_height: Annotated[float, Interval(ge=0.5, le=20.0), Unit("1")] = described(
        2.0, "ratio of the height of the punch to a"
    )
    half_plane_size: Annotated[float, Interval(ge=2.0, le=1000.0), Unit("1")] = described(
        40.0, "ratio of width and depth of the half-plane to a"
    )
    punch_stiffness: Annotated[float, Interval(ge=1e-4, le=1e4), Unit("1")] = described(
        1.0, "ratio of Young's modulus of the punch to that of the half-plane"
    )
    elastic_punch: bool = described(False, "whether the punch never yields")
    smallest_element: Annotated[float, Interval(ge=1e-5, le=0.1), Unit("1")] = by_accuracy(
        "ratio of the smallest element side, at the corner, to a"
    )
    growth: Annotated[float, Interval(ge=1.05, le=3.0), Unit("1")] = by_accuracy(
        "ratio of neighbouring element sides away from the corner"
    )
    element: Literal["quad8", "quad9", "quad4", "tri6", "tri3"] = described(
        "quad8", "element of both bodies"
    )
    load_step: Annotated[float, Interval(ge=1e-4, le=1.0), Unit("1")] = by_accuracy(
        "largest increment of load_ratio"
    )
    unload_steps: Annotated[int, Interval(ge=1, le=1000)] = described(5, "increments of unloading")

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ContactParameters.__post_init__(self)
        elements = sum(each.elements for each in self.grid_sizes("quad8"))
        if elements > _MOST_ELEMENTS:
            raise ModelError(
                "smallest_element", self.smallest_element,
                f"makes {elements} elements with growth {self.growth:g}; at most "
                f"{_MOST_ELEMENTS} are allowed: raise growth or smallest_element",
            )  # fmt: skip

    @property
    def lines(self) -> Lines:
        """Grid lines of both meshes; their spacing decreases towards the corner."""
        a = self.half_width
        return _lines(
            a, self.punch_height * a, self.half_plane_size * a, self.smallest_element * a,
            self.growth,
        )  # fmt: skip

    def grid_sizes(self, element: str) -> tuple[GridSize, GridSize]:
        """Return the sizes of the grids of punch and half-plane."""
        under, beyond, up, down = (len(each) - 1 for each in self.lines)
        return grid_size(under, up, element), grid_size(under + beyond, down, element)

    @property
    def corner(self) -> SingularPoint:
        """The corner of the punch, at which strain is unbounded.

        Its radius is the distance of the first published number: there strain converges as the mesh
        is refined, nearer to the corner it does not.
        """
        radius = max(_NEAREST, _DIAGONAL * self.smallest_element) * self.half_width
        return SingularPoint(at=(self.half_width, 0.0), radius=radius)

    def usual(self) -> Mapping[str, float]:
        """Return the mesh and the increments of an accuracy."""
        return _USUAL[self.accuracy]


@lru_cache(maxsize=256)
def _lines(a: float, height: float, size: float, smallest: float, growth: float) -> Lines:
    away = (smallest, math.inf)
    return Lines(
        under=refined((0.0, a), away[::-1], growth, [_LARGEST * a]),
        beyond=refined((a, size), away, growth, [size / 4]),
        up=refined((0.0, height), away, growth, [_PUNCH_LARGEST * a]),
        down=-refined((0.0, size), away, growth, [size / 4])[::-1],
    )


def model(parameters: PunchParameters) -> Model:
    """Return the half model: bodies, supports, pressure and contact.

    The middle is held along x, the bottom of the half-plane along y; the punch is held by contact
    alone.
    """
    from solver.mesh.elements import element_type  # loads scikit-fem

    p, (under, beyond, up, down) = parameters, parameters.lines
    cells = element_type(p.element).cells
    punch = Body(
        name="punch",
        mesh=grid(under, up, cells),
        material=p.material(p.punch_stiffness, elastic=p.elastic_punch),
        kinematics=p.state,
        element=p.element,
        supports={"left": "x"},
        pressure={"top": p.yield_stress},
    )
    half_plane = Body(
        name="half_plane",
        mesh=grid(np.concatenate([under, beyond[1:]]), down, cells),
        material=p.material(),
        kinematics=p.state,
        element=p.element,
        supports={"left": "x", "bottom": "y"},
    )
    contact = p.contact(slave=("punch", "bottom"), master=("half_plane", "top"))
    return Model(bodies=(punch, half_plane), contacts=(contact,), singular=(p.corner,))


def program(parameters: PunchParameters) -> Program:
    """Return the loading history: the pressure is raised, then removed with the punch."""
    p = parameters
    pressed = load_and_release(p.load_ratio, p.load_step, p.unload_steps)
    return replace(pressed, place="load_ratio {:.6g}".format)


def effort(parameters: PunchParameters, load_ratios: Sequence[float]) -> Effort:
    """Return the work of loading to each load ratio in turn and of releasing from each."""
    punch, plane = parameters.grid_sizes(parameters.element)
    # an elastic punch is reduced to its contact surface; x is held on the line of symmetry
    own = 2 * punch.along - 1 if parameters.elastic_punch else 2 * punch.nodes - punch.up
    increments = _increments(tuple(load_ratios), parameters.load_step, parameters.unload_steps)
    return Effort(
        elements=punch.elements + plane.elements,
        unknowns=own + 2 * plane.nodes - plane.up - plane.along,
        increments=increments,
        most_increments=increments,
    )


@lru_cache(maxsize=1024)
def _increments(load_ratios: tuple[float, ...], step: float, unload_steps: int) -> int:
    return walked([load_and_release(load, step, unload_steps) for load in sorted(load_ratios)])


def view(parameters: PunchParameters) -> View:
    """Return the positions of results, which depend on dimensions and not on the mesh."""
    a = parameters.half_width
    height = min(0.6, parameters.punch_height) * a
    within = _pixels(a, a)
    inside = np.unique(np.concatenate([[0.005, 0.01, 0.028, 0.05, 0.1],
                                       np.geomspace(5e-4, 1.0, 67)]))  # fmt: skip
    outside = np.geomspace(5e-4, 0.98, 40)
    return View(
        x=np.concatenate([a - within[::-1], a + _pixels(0.6 * a, a)]),
        y=np.concatenate([-within[::-1], _pixels(height, a)]),
        depth=np.concatenate([[0.0], a * np.geomspace(1e-3, 1.9, 80)]),
        station=a * np.array([0.0, 0.5, 0.9, 0.972, 0.995, 1.0]),
        s=a * np.concatenate([1.0 - inside[::-1], [1.0], 1.0 + outside]),
        profile_body="half_plane",
        surfaces={"punch": "bottom", "half_plane": "top"},
        symmetric=True,
    )


def _pixels(length: float, a: float) -> NDArray[np.float64]:
    """Return distances of map positions from the corner, as fine as elements of ``standard``."""
    return cells(length, smallest=5e-4 * a, ratio=1.1, largest=0.0125 * a)


RESIDUAL_X = {
    "half_plane": declare(
        "residual_x_half_plane",
        "residual stress xx on the half-plane, 0.005 half-widths inside the corner", "MPa",
    ),
    "punch": declare(
        "residual_x_punch",
        "residual stress xx on the punch, 0.028 half-widths inside the corner", "MPa",
    ),
}  # fmt: skip
MAX_PLASTIC_STRAIN = {
    "punch": declare("max_plastic_strain_punch", "largest equivalent plastic strain in the punch"),
    "half_plane": declare(
        "max_plastic_strain_half_plane", "largest equivalent plastic strain in the half-plane"
    ),
}
FREE_SURFACE = declare(
    "audit_free_surface", "ratio of the residual stress normal to the free side to the yield stress"
)
SELF_EQUILIBRIUM = declare(
    "audit_self_equilibrium",
    "ratio of the residual normal force on a plane cut to yield stress times area",
)
_INSIDE = {"half_plane": _NEAREST, "punch": 0.028}
"""Ratio of the distance from the corner at which the publication has residual stress to a."""


def figures(run: FinishedRun) -> Values:
    """Return the figures of the punch, including those of the publication."""
    from solver.results.audit.cut import cut_force  # loads scipy

    samples, system, unloaded = run.samples, run.system, run.unloaded
    a, s = run.parameters.half_width, run.view.s
    out: dict[Quantity, float] = {}
    for body, distance in _INSIDE.items():
        sigma = samples.on_surface("stress", body, unloaded)[0]
        at = int(np.argmin(np.abs(s - a * (1 - distance))))
        out[RESIDUAL_X[body]] = float(sigma[at])
    for body, quantity in MAX_PLASTIC_STRAIN.items():
        strain = system.response(body, unloaded).state.accumulated
        out[quantity] = float(strain.max())
    # the free side of the punch carries no sigma_x: what remains is error
    nodes = system.full("punch").boundary_nodes("right")
    side = samples.fields.at_nodes(unloaded, "punch").stress[0, nodes]
    out[FREE_SURFACE] = float(np.abs(side).max() / run.parameters.yield_stress)
    # nothing pushes on the half-plane any more: a horizontal cut carries no normal force
    width = float(system.full("half_plane").X[0].max())
    line = np.linspace(0.0, width * (1 - 1e-9), 8000)
    cut = np.stack([line, np.full_like(line, -0.5 * a)])
    stress = system.response("half_plane", unloaded).stress
    out[SELF_EQUILIBRIUM] = abs(cut_force(system, "half_plane", stress, cut))
    return out


PUNCH = Scene(
    name="punch",
    summary="elastic-plastic punch pressed on an elastic-plastic half-plane, and released",
    parameters=PunchParameters,
    branch="load_ratio",
    model=model,
    program=program,
    view=view,
    outputs=(maps, profiles, surfaces, contact, extremes, residual_extremes, figures),
    costs=(cost,),
    increment_error=0.04,  # the error of the mesh is larger
    effort=effort,
    advice={
        Status.LIMIT_LOAD: "lower load_ratio, or let the material harden",
        Status.NOT_CONVERGED: "reduce load_step, or refine the mesh by smallest_element or growth",
    },
)
