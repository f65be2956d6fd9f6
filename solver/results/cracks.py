"""Stress intensities at the tips of cracks, at each stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from solver.contact.state import BodyState
from solver.fem.surface import edges_of
from solver.fracture.intensity import (
    AtPoints,
    PlaneElasticity,
    Tip,
    by_displacements,
    by_integral,
    tensor,
    tips_of,
)
from solver.mesh.edges import shape_functions
from solver.parameters import Checked, described
from solver.results.outputs import output
from solver.results.quantities import along_axes, declare, declare_along
from solver.results.run import FinishedRun, Values
from solver.results.shakedown import QUIET
from solver.typing import Array, Ints

_UNIT, _OVER = "MPa mm^0.5", ("tip", "stage")
TIP = declare("tip", "tip of a crack", "", dims=("tip",))
TIP_AT = declare_along("tip_{}", "position of the tip along {}", "mm", dims=("tip",))
MODES = tuple(
    declare(f"K_{mode}", f"stress intensity of mode {mode} at the tip", _UNIT, dims=_OVER)
    for mode in ("I", "II")
)
OF_FACES = tuple(
    declare(
        f"K_{mode}_faces", f"stress intensity of mode {mode} from displacements of the faces",
        _UNIT, dims=_OVER,
    )
    for mode in ("I", "II")
)  # fmt: skip
_RINGS = 4
_CLOSING = 0.01
"""Negative K_I over K, up to which it may be an error of the integral."""


class StressIntensity(NamedTuple):
    """Stress intensities at a tip [MPa sqrt(mm)].

    Attributes
    ----------
    tip : its name
    at : position (2,) [mm]
    K : K_I and K_II (2,) by the interaction integral; NaN where it does not hold, see `why`
    of_faces : K_I and K_II (2,) from displacements of the faces
    why : why the integral does not hold; empty if it does
    overlap : whether the faces overlap: they would close, and have no contact pair
    """

    tip: str
    at: Array
    K: Array
    of_faces: Array
    why: str
    overlap: bool = False


def stress_intensities(system: Any, converged: Any, rings: int = _RINGS) -> list[StressIntensity]:
    """Return the stress intensities at all tips in a state.

    The domain of the integral is so many rings of elements around the tip and the next one, fewer
    if these would reach the outline or another crack. In the last one the body must be elastic:
    plastic strain nearer to the tip is allowed, K is then that of the elastic field around it.
    """
    found = []
    for name in system.names:
        body = system.full(name)
        tips = tips_of(body) if body.body.cracks else []
        state = system.state(name, converged) if tips else None
        found += [_at(system, converged, state, tip, rings) for tip in tips]
    return found


def _at(system: Any, converged: Any, state: Any, tip: Tip, rings: int) -> StressIntensity:
    part: Any = tip.part
    body, time, shape = part.body, state.time, part.weights.shape
    law = body.material.elasticity
    elastic = PlaneElasticity.of(
        law.youngs_modulus, law.poisson_ratio, plane_stress=body.kinematics == "plane_stress"
    )
    u = state.u.reshape(-1, 2)
    of_faces = by_displacements(tip, u, elastic)
    q, done = tip.domain(rings)
    why = _void(system, part, state, tip, q) if done else "its elements reach the outline"
    if why:
        return StressIntensity(tip.name, tip.at, np.full(2, np.nan), of_faces, why)
    given = part.eigenstrain(time)
    strain = state.strain - given - state.plastic.plastic_strain
    pushed = np.zeros((2, *shape))
    for load in body.every_load:
        force = load.body_force(part.positions)
        if force is not None:
            pushed += load.factor(time) * force.reshape(pushed.shape)
    field = AtPoints(
        u, tensor(state.stress, shape), tensor(strain, shape), tensor(given, shape), pushed
    )
    upper, lower = (
        partial(_on_face, _acting(system, converged, tip, k), part, time) for k in (0, 1)
    )
    K = by_integral(tip, field, elastic, q, (upper, lower))
    touching = any({i.declared.slave, i.declared.master} == tip.sides for i in system.interfaces)
    overlap = bool(K[0] < -_CLOSING * np.hypot(*K)) and not touching
    return StressIntensity(tip.name, tip.at, K, of_faces, "", overlap)


def _void(system: Any, part: Any, state: BodyState, tip: Tip, q: Array) -> str:
    """Return why the integral does not hold; empty if it does."""
    inside = q[part.basis.element_dofs]
    ring = np.repeat((np.ptp(inside, axis=0) > 0), part.weights.shape[1])
    strained = np.abs(state.strain[:, ring]).max()
    if state.plastic.accumulated[ring].max(initial=0.0) > QUIET * strained:
        return "plastic strain reaches through the domain"
    domain = np.repeat(inside.any(axis=0), part.weights.shape[1])
    stiff = np.broadcast_to(getattr(part.law(state.time), "stiff", 1.0), domain.shape)[domain]
    if (stiff != 1).any():
        return "stiffness differs in the domain"
    free = np.isin(np.arange(part.n), part.free).reshape(-1, 2)
    held = np.asarray(~free.all(axis=1))
    for link in system.model.links:
        for name, boundary in link.sides:
            if name == part.body.name:
                held[part.boundary_nodes(boundary)] = True
    if (q[held] > 0).any():
        return "supports, prescribed displacements or links hold nodes of the domain"
    for interface in system.interfaces:
        pair = interface.declared
        sides = {pair.slave, pair.master}
        own = [part.body.facets(boundary) for name, boundary in sides if name == part.body.name]
        if sides != tip.sides and any(np.isin(each, tip.facets).any() for each in own):
            return "a face touches another boundary than the whole other face"
    return ""


_Contact = Callable[[Array, Ints], Array] | None


def _acting(system: Any, converged: Any, tip: Tip, face: int) -> _Contact:
    """Return the traction of contact on the upper (0) or lower (1) face; None without contact.

    It is the field of the contact problem: values at the vertices of the slave, linear in between.
    """
    for k, interface in enumerate(system.interfaces):
        pair = interface.declared
        if {pair.slave, pair.master} != tip.sides:
            continue
        contact = converged.state.contacts[k]
        area = system.pairing(converged.state, k).area
        normal, shear = (
            np.divide(own, area, out=np.zeros_like(own), where=area > 0)
            for own in (contact.normal, contact.tangential)
        )
        chain = interface.slave_surface
        along = tip.ahead  # the slave's chain runs along its face; that of the upper one ahead
        upper = bool(np.isin(tip.edges[0][0, 2], chain.nodes))
        ahead = 1.0 if upper else -1.0
        outward = np.array([along[1], -along[0]]) * ahead
        traction = -normal * outward[:, None] + shear * ahead * along[:, None]
        s = (tip.at[:, None] - chain.X[:, chain.vertices]).T @ along
        sign = 1.0 if upper == (face == 0) else -1.0
        order = np.argsort(s)
        return partial(_interpolated, s[order], sign * traction[:, order], tip)
    return None


def _interpolated(s: Array, traction: Array, tip: Tip, x: Array, edges: Ints) -> Array:
    """Return tractions (2, n_edges, n_points), linear in the parameter of each edge."""
    X = tip.part.X[:, edges[:, :2]]
    ends = np.einsum("a,aek->ek", tip.ahead, tip.at[:, None, None] - X)
    hats = shape_functions(np.polynomial.legendre.leggauss(x.shape[2])[0], 2)
    return np.stack([np.interp(ends, s, own) @ hats.T for own in traction])


def _on_face(
    contact: _Contact, part: Any, time: float, x: Array, along: Array, edges: Ints
) -> Array:
    """Return the forces (2, n_edges, n_points) of loads and contact on pieces of a face [N/mm]."""
    total = np.zeros(x.shape)
    for load in part.body.every_load:
        for boundary in load.boundaries:
            loaded = np.isin(edges[:, 2], edges_of(part, boundary)[:, 2])
            here = (each[:, loaded].reshape(2, -1) for each in (x, along))
            pushed = load.push_at(time, *here)
            if pushed is not None:
                total[:, loaded] += pushed.reshape(2, -1, x.shape[2])
    if contact is not None:
        total += contact(x, edges) * np.linalg.norm(along, axis=0)
    return total


@output("cracks", "crack")
@dataclass(frozen=True, slots=True, kw_only=True)
class Cracks(Checked):
    """Stress intensities K_I and K_II at the tips of all cracks."""

    rings: Annotated[int, Interval(ge=1, le=100)] = described(
        _RINGS, "rings of elements around a tip in the domain of the integral"
    )

    def _each(self, run: FinishedRun) -> list[list[StressIntensity]]:
        if self not in run.kept:
            run.kept[self] = [stress_intensities(run.system, at, self.rings)
                              for at, _ in run.stages]  # fmt: skip
        found: list[list[StressIntensity]] = run.kept[self]
        return found

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        stages = self._each(run)
        tips = stages[0]
        K, of_faces = (
            np.array([[getattr(tip, name) for tip in stage] for stage in stages]).transpose(2, 1, 0)
            for name in ("K", "of_faces")
        )
        return {
            TIP: np.array([tip.tip for tip in tips]),
            **along_axes(TIP_AT, np.array([tip.at for tip in tips]).T),
            **dict(zip(MODES, K, strict=True)),
            **dict(zip(OF_FACES, of_faces, strict=True)),
        }

    def warnings(self, run: FinishedRun) -> tuple[str, ...]:
        """Return why intensities are not known, and where faces overlap."""
        each = [tip for stage in self._each(run) for tip in stage]
        found = [f"K of tip {tip.tip} is not known: {tip.why}" for tip in each if tip.why]
        found += [
            f"K_I of tip {tip.tip} is negative: the faces overlap, give them a contact"
            for tip in each if tip.overlap
        ]  # fmt: skip
        return tuple(dict.fromkeys(found))
