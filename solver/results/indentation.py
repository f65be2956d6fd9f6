"""What a ball does: force, approach, contact radius, and the crater that it leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.results.quantities import declare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.results.look import Look, Values
    from solver.results.samples import Bodies, Samples, Solved

    Array = NDArray[np.float64]

FORCE = declare("force", "force on the ball under load", "N")
APPROACH = declare("approach", "displacement of the ball's centre under load", "mm")
CONTACT_RADIUS = declare("contact_radius", "radius of the contact under load", "mm")
MEAN_CONTACT_PRESSURE = declare(
    "mean_contact_pressure", "force / area of the contact under load", "MPa"
)
CRATER_DEPTH = declare(
    "crater_depth", "depth that is left where the contact was, at its middle", "mm"
)
PILE_UP = declare("pile_up", "height of the pile-up that is left around the contact", "mm")
PILE_UP_RADIUS = declare("pile_up_radius", "radius at which the pile-up is highest", "mm")
SURFACE_DISPLACEMENT = declare(
    "surface_displacement",
    "vertical displacement of the surface of the body that yields, from the centre of a ball", "mm",
    dims=("stage", "s"),
)  # fmt: skip
INCREMENT = declare(
    "increment", "number of the increment; 0 is the state before loading", dims=("increment",),
    count=True,
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
    """A state of a ball: force [N], approach and contact radius [mm]."""

    force: float
    approach: float
    radius: float


def follow(samples: Samples, converged: Any) -> Followed:
    """Return what is kept of an increment."""
    system = samples.system
    contact = converged.state.contacts[0]
    force = float(contact.normal.sum())
    return Followed(force, _approach(system, converged), _radius(system, converged))


def _approach(system: Bodies, converged: Solved) -> float:
    """Return by how much the centre of the ball has come nearer to what it is pressed on [mm]."""
    body = system.full("ball")
    axis = body.boundary_nodes("left")
    axis = axis[np.argsort(body.X[1, axis])]
    moved = system.displacement("ball", converged.state)[2 * axis + 1]
    y = body.X[1, axis]
    radius = _ball_radius(body.X)
    centre = radius if y.max() > 0 else -radius
    return float(-np.sign(centre) * np.interp(centre, y, moved))


def _ball_radius(X: Array) -> float:
    """Return the radius of a ball that touches the origin, from its nodes (2, n)."""
    far = np.argmax(X[0])
    return float((X[:, far] ** 2).sum() / (2 * abs(X[1, far])))


def _radius(system: Any, converged: Any) -> float:
    """Return the radius of the contact [mm], 0 without contact.

    Beyond the edge of a contact the gap opens as the distance to the power 3/2. Its power 2/3 at
    the two points next to the edge lies on a line that ends there.
    """
    state, chain = converged.state, system.interfaces[0].slave_surface
    x = chain.X[0, chain.vertices]
    order = np.argsort(x)
    x, closed = x[order], np.flatnonzero(state.contacts[0].normal[order] > 0)
    if not len(closed):
        return 0.0
    last = int(closed[-1])
    # the hat of the first open vertex reaches into the contact
    here = slice(last + 2, last + 4)
    gap = state.contacts[0].gap[order][here]
    if len(gap) < 2 or not (np.isfinite(gap).all() and 0 < gap[0] < gap[1]):
        return float(x[last])
    near, far = gap ** (2 / 3)
    edge = x[here][0] - near * np.diff(x[here])[0] / (far - near)
    return float(np.clip(edge, x[max(last - 1, 0)], x[last + 1]))


def indentation(look: Look) -> Values:
    """Return force, approach, contact radius and mean pressure under load."""
    force, approach, radius = follow(look.samples, look.loaded)
    mean = force / (np.pi * radius**2) if radius else np.nan
    return {
        FORCE: force, APPROACH: approach, CONTACT_RADIUS: radius, MEAN_CONTACT_PRESSURE: mean
    }  # fmt: skip


def crater(look: Look) -> Values:
    """Return how the surface of the body that yields has moved, and what is left of it."""
    s, name = look.view.s, look.view.profile_body
    body = look.system.full(name)
    nodes = body.boundary_nodes(look.view.surfaces[name])
    nodes = nodes[np.argsort(body.X[0, nodes])]

    def moved(converged: Solved) -> Array:
        u = look.system.displacement(name, converged.state)[2 * nodes + 1]
        centre = _approach(look.system, converged) if name == "ball" else 0.0
        return np.asarray(np.interp(s, body.X[0, nodes], u) - centre)

    left = moved(look.unloaded)
    highest = int(left.argmax())
    return {
        SURFACE_DISPLACEMENT: np.stack([moved(look.loaded), left]),
        CRATER_DEPTH: -float(left[0]),
        PILE_UP: float(left[highest]),
        PILE_UP_RADIUS: float(s[highest]) if left[highest] > 0 else np.nan,
    }


def history(look: Look) -> Values:
    """Return force, approach and contact radius of every increment."""
    force, approach, radius = np.array(look.outcome.history).T
    return {
        INCREMENT: np.arange(len(force)),
        INCREMENT_FORCE: force,
        INCREMENT_APPROACH: approach,
        INCREMENT_RADIUS: radius,
    }
