"""Indentation by a ball: force, approach, and the crater that remains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.results.contact_result import contact_patches
from solver.results.increments import INCREMENT
from solver.results.quantities import declare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.results.fields import Bodies, Solved
    from solver.results.run import FinishedRun, Values
    from solver.results.samples import Samples

    Array = NDArray[np.float64]

FORCE = declare("force", "force on the ball under load", "N")
APPROACH = declare("approach", "displacement of the ball's centre under load", "mm")
MEAN_CONTACT_PRESSURE = declare("mean_contact_pressure", "force per contact area under load", "MPa")
CRATER_DEPTH = declare(
    "crater_depth", "depth of the crater after unloading, at the middle of the contact", "mm"
)
PILE_UP = declare("pile_up", "height of the pile-up around the contact after unloading", "mm")
PILE_UP_RADIUS = declare("pile_up_radius", "radius at which the pile-up is highest", "mm")
SURFACE_DISPLACEMENT = declare(
    "surface_displacement",
    "vertical displacement of the surface of the body that yields, from the centre of a ball", "mm",
    dims=("stage", "s"),
)  # fmt: skip
_EACH = ("increment",)
INCREMENT_FORCE = declare("increment_force", "force after each increment", "N", dims=_EACH)
INCREMENT_APPROACH = declare(
    "increment_approach", "displacement of the ball's centre after each increment", "mm", dims=_EACH
)
INCREMENT_RADIUS = declare(
    "increment_radius", "radius of the contact after each increment", "mm", dims=_EACH
)


class Followed(NamedTuple):
    """A state of a ball: force [N], approach [mm] and contact radius [mm]."""

    force: float
    approach: float
    radius: float


def follow(samples: Samples, converged: Any) -> Followed:
    """Return the stored numbers of an increment."""
    system: Any = samples.system
    contact = converged.state.contacts[0]
    force = float(contact.normal.sum())
    chain = system.interfaces[0].slave_surface
    x = chain.X[0, chain.vertices]
    order = np.argsort(x)
    patches = contact_patches(x[order], contact.gap[order], contact.normal[order] > 0)
    return Followed(force, _approach(system, converged), patches[-1][1] if patches else 0.0)


def _approach(system: Bodies, converged: Solved) -> float:
    """Return the displacement of the ball's centre towards the other body [mm]."""
    body = system.full("ball")
    axis = body.boundary_nodes("left")
    axis = axis[np.argsort(body.X[1, axis])]
    moved = system.displacement("ball", converged.state)[2 * axis + 1]
    y = body.X[1, axis]
    radius = _ball_radius(body.X)
    centre = radius if y.max() > 0 else -radius
    return float(-np.sign(centre) * np.interp(centre, y, moved))


def _ball_radius(X: Array) -> float:
    """Return the radius [mm] of a ball that touches the origin, from its nodes (2, n) [mm]."""
    far = np.argmax(X[0])
    return float((X[:, far] ** 2).sum() / (2 * abs(X[1, far])))


def indentation(run: FinishedRun) -> Values:
    """Return force, approach and mean pressure under load."""
    force, approach, radius = follow(run.samples, run.loaded)
    mean = force / (np.pi * radius**2) if radius else np.nan
    return {FORCE: force, APPROACH: approach, MEAN_CONTACT_PRESSURE: mean}


def crater(run: FinishedRun) -> Values:
    """Return the surface displacement of the body that yields, crater depth and pile-up."""
    s, name = run.view.s, run.view.profile_body
    body = run.system.full(name)
    nodes = body.boundary_nodes(run.view.surfaces[name])
    nodes = nodes[np.argsort(body.X[0, nodes])]

    def moved(converged: Solved) -> Array:
        u = run.system.displacement(name, converged.state)[2 * nodes + 1]
        centre = _approach(run.system, converged) if name == "ball" else 0.0
        return np.asarray(np.interp(s, body.X[0, nodes], u) - centre)

    left = moved(run.unloaded)
    highest = int(left.argmax())
    return {
        SURFACE_DISPLACEMENT: np.stack([moved(run.loaded), left]),
        CRATER_DEPTH: -float(left[0]),
        PILE_UP: float(left[highest]),
        PILE_UP_RADIUS: float(s[highest]) if left[highest] > 0 else np.nan,
    }


def history(run: FinishedRun) -> Values:
    """Return force, approach and contact radius of every increment."""
    force, approach, radius = np.array(run.outcome.history).T
    return {
        INCREMENT: np.arange(len(force)),
        INCREMENT_FORCE: force,
        INCREMENT_APPROACH: approach,
        INCREMENT_RADIUS: radius,
    }
