"""Indentation by a ball: force, approach, crater; by a sharp rigid body: force and work."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from typing import Any

import numpy as np

from solver.fem.nodes import Dofs, vectors
from solver.mesh.rounding import ROUNDED
from solver.parameters import Checked, Length, described
from solver.results.acting import contact_patches
from solver.results.fields import Bodies, Solved
from solver.results.increments import curve
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.typing import Array

FORCE = declare("force", "force of the contact on the ball, along its axis, under load", "N")
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


@output("indentation", "contact", "s", "profile", "surfaces", "release")
@dataclass(frozen=True, slots=True, kw_only=True)
class Indentation(Checked):
    """Force, approach, mean pressure under load, and the displacement of the profile's surface.

    The ball touches the origin, and its axis is x = 0. Force, approach and contact radius are also
    stored after every increment.
    """

    body: str = described(MISSING, "name of the ball")
    radius: Length = described(MISSING, "radius of the ball")

    def watch(self, system: Any, converged: Any) -> Values:
        """Return force, approach and contact radius of an increment."""
        contact = converged.state.contacts[0]
        chain = system.interfaces[0].slave_surface
        x = chain.X[0, chain.vertices]
        order = np.argsort(x)
        patches = contact_patches(x[order], contact.gap[order], contact.normal[order] > 0)
        return {
            INCREMENT_FORCE: self._force(system, converged),
            INCREMENT_APPROACH: self._approach(system, converged),
            INCREMENT_RADIUS: patches[-1][1] if patches else 0.0,
        }

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        force, approach, radius = self.watch(run.system, run.loaded).values()
        mean = force / (np.pi * radius**2) if radius else np.nan
        s, residual = run.view.s, self._moved(run, run.unloaded)
        highest = int(residual.argmax())
        return {
            FORCE: force,
            APPROACH: approach,
            MEAN_CONTACT_PRESSURE: mean,
            SURFACE_DISPLACEMENT: np.stack([self._moved(run, run.loaded), residual]),
            CRATER_DEPTH: -float(residual[0]),
            PILE_UP: float(residual[highest]),
            PILE_UP_RADIUS: float(s[highest]) if residual[highest] > 0 else np.nan,
        }

    def _moved(self, run: FinishedRun, converged: Solved) -> Array:
        """Return the displacement along y of the surface of the profile's body, over s [mm]."""
        name = run.view.profile_body
        body = run.system.full(name)
        nodes = body.boundary_nodes(run.view.surfaces[name])
        nodes = nodes[np.argsort(body.X[0, nodes])]
        u = run.system.state(name, converged).u[Dofs(nodes, 2).along(1)]
        centre = self._approach(run.system, converged) if name == self.body else 0.0
        return np.asarray(np.interp(run.view.s, body.X[0, nodes], u) - centre)

    def _force(self, system: Any, converged: Any) -> float:
        """Return the force of the contact on the ball along its axis [N]."""
        forces = converged.contact_forces[system.all_names.index(self.body)]
        return abs(float(vectors(forces, 2)[1].sum()))

    def _approach(self, system: Bodies, converged: Solved) -> float:
        """Return the displacement of the ball's centre towards the other body [mm]."""
        X = system.full(self.body).X
        axis = np.flatnonzero(np.abs(X[0]) <= ROUNDED * self.radius)
        axis = axis[np.argsort(X[1, axis])]
        moved = system.state(self.body, converged).u[Dofs(axis, 2).along(1)]
        y = X[1, axis]
        centre = self.radius if y.max() > 0 else -self.radius
        return float(-np.sign(centre) * np.interp(centre, y, moved))


LOADING_CURVATURE = declare(
    "loading_curvature", "force over the square of the depth at the largest depth", "MPa"
)
IRREVERSIBLE_WORK = declare(
    "irreversible_work", "share of the work of pressing in that withdrawal does not give back"
)


@output("sharp_indentation", "release")
@dataclass(frozen=True, slots=True, kw_only=True)
class SharpIndentation(Checked):
    """Force and work of a rigid cone or wedge that moves into a body along y, and back.

    Work is integrated by the trapezoidal rule over increments. The share that withdrawal gives back
    is known only if the body is still pressed after two increments of it.
    """

    rigid: str = described(MISSING, "name of the rigid body")

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        y, force, deepest, resolved = self._course(run)
        into = np.trapezoid(force[: deepest + 1], y[: deepest + 1])
        back = -np.trapezoid(force[deepest:], y[deepest:])
        return {
            LOADING_CURVATURE: float(force[deepest] / y[deepest] ** 2),
            IRREVERSIBLE_WORK: float(1 - back / into) if resolved else np.nan,
        }

    def warnings(self, run: FinishedRun) -> tuple[str, ...]:
        """Return a warning if withdrawal is in too few increments for its work."""
        if self._course(run)[3]:
            return ()
        return (
            f"{self.rigid} leaves the body within two increments of withdrawal, so that "
            "irreversible_work is unknown: use more of them",
        )

    def _course(self, run: FinishedRun) -> tuple[Array, Array, int, bool]:
        """Return depth, force, the number of the deepest, and whether withdrawal is resolved."""
        _, _, y, _, _, force, _ = np.abs(curve(run.outcome.history, self.rigid))
        deepest = int(y.argmax())
        after = force[deepest + 1 : deepest + 3]
        return y, force, deepest, len(after) == 2 and bool((after > 0).all())
