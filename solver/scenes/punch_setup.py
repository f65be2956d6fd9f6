"""The bodies, the loading and the results of the punch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from skfem import Mesh

from solver.fem.fields import Sampler, recovery
from solver.loading.program import Program, load_and_release, walked
from solver.mesh.elements import element_type
from solver.mesh.grids import grid, grid_size, marked
from solver.mesh.lines import cells
from solver.model.body import Body
from solver.model.model import Model
from solver.results.quantities import Quantity, declare
from solver.results.run import FinishedRun, Values
from solver.results.view import View
from solver.scenes.punch import NEAREST, PunchParameters
from solver.scenes.scene import Effort
from solver.typing import Array

_NEAR = 0.1
"""Half the side of the square region of large strain around the corner, over a."""


def model(parameters: PunchParameters) -> Model:
    """Return the half model: bodies, supports, pressure and contact.

    The middle is held along x, the bottom of the half-plane along y; the punch is held by contact
    alone.
    """
    p, (under, beyond, up, down) = parameters, parameters.lines
    cells = element_type(p.element).cells
    punch = Body(
        name="punch",
        **_strained(p, grid(under, up, cells)),
        material=p.material(p.punch_stiffness, elastic=p.elastic_punch),
        kinematics=p.state,
        element=p.element,
        supports={"left": "x"},
        pressure={"top": p.yield_stress},
    )
    half_plane = Body(
        name="half_plane",
        **_strained(p, grid(np.concatenate([under, beyond[1:]]), down, cells)),
        material=p.material(),
        kinematics=p.state,
        element=p.element,
        supports={"left": "x", "bottom": "y"},
    )
    sliding: Literal["small", "finite"] = "small" if p.strain == "small" else "finite"
    contact = p.contact(("punch", "bottom"), ("half_plane", "top"), sliding)
    return Model(bodies=(punch, half_plane), contacts=(contact,), singular=(p.corner,))


def _strained(p: PunchParameters, mesh: Mesh) -> dict[str, Any]:
    """Return the mesh of a body, and where its strain is large."""
    if p.strain != "region":
        return {"mesh": mesh, "strain": p.strain}
    a, near = p.half_width, _NEAR * p.half_width
    mesh = marked(mesh, "corner", (a - near, a + near), (-near, near))
    return {"mesh": mesh, "strain": "large", "large_region": "corner"}


def program(parameters: PunchParameters) -> Program:
    """Return the loading history: the pressure is raised, then removed with the punch."""
    p = parameters
    pressed = load_and_release(p.load_ratio, p.load_step, p.unload_steps)
    return replace(pressed, place="load_ratio {:.6g}".format)


def effort(parameters: PunchParameters, load_ratios: Sequence[float]) -> Effort:
    """Return the work of loading to each load ratio in turn and of releasing from each."""
    under, beyond, up, down = parameters.lines
    punch = grid_size(under, up, parameters.element)
    plane = grid_size([*under, *beyond[1:]], down, parameters.element)
    # an elastic punch is reduced to its contact surface; x is held on the line of symmetry
    condensed = parameters.elastic_punch and parameters.strain == "small"
    own = 2 * punch.along - 1 if condensed else 2 * punch.nodes - punch.up
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


def _pixels(length: float, a: float) -> Array:
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
_INSIDE = {"half_plane": NEAREST, "punch": 0.028}
"""Distance from the corner at which residual stress is published, over a."""


def figures(run: FinishedRun) -> Values:
    """Return the figures of the punch, including those of the publication."""
    samples, system, unloaded = run.samples, run.system, run.unloaded
    a, s = run.parameters.half_width, run.view.s
    out: dict[Quantity, float] = {}
    for body, distance in _INSIDE.items():
        sigma = samples.on_surface("stress", body, unloaded)[0]
        at = int(np.argmin(np.abs(s - a * (1 - distance))))
        out[RESIDUAL_X[body]] = float(sigma[at])
    for body, quantity in MAX_PLASTIC_STRAIN.items():
        strain = system.state(body, unloaded).plastic.accumulated
        out[quantity] = float(strain.max())
    # the free side of the punch carries no sigma_x: what remains is error
    nodes = system.full("punch").boundary_nodes("right")
    side = samples.fields.at_nodes(unloaded, "punch").stress[0, nodes]
    out[FREE_SURFACE] = float(np.abs(side).max() / run.parameters.yield_stress)
    # nothing pushes on the half-plane any more: a horizontal cut carries no normal force
    part = system.full("half_plane")
    line = np.linspace(0.0, part.X[0].max() * (1 - 1e-9), 8000)
    cut = np.stack([line, np.full_like(line, -0.5 * a)])
    along = recovery(part) @ system.state("half_plane", unloaded).stress[1]
    depth = np.broadcast_to(part.measure(cut), line.shape)
    force, area = np.trapezoid([Sampler(part, cut)(along) * depth, depth], line)
    out[SELF_EQUILIBRIUM] = abs(float(force)) / (area * run.parameters.yield_stress)
    return out
