"""Estimate of the error of small-strain theory: the stress that large strain would add.

Let T be the stress of a converged state, H the displacement gradient and e its symmetric part, the
strain. A theory of large strain differs in two ways.

1. Equilibrium holds in the deformed configuration. T rotates with the material by R, the rotation
   of I + H, and acts on stretched areas: its nominal stress is R N, with N = T - (T e + e T) / 2.
2. The strain is logarithmic, E = ln((I + H)'(I + H)) / 2. For a body that rotates, the same linear
   displacements give a stretch in E - e of about half the square of the angle.

The estimate is the stress s with which T + s satisfies both. With the strain operator B of the
bodies, the tangent D of their points, and their joined stiffness K by D, it grows from a state of
the path (the end of a stage) to the next by

    ds = D (d(E - e) + B v),   K v = -f(s + R N - T + D d(E - e))

where f are nodal forces, of which v removes those that neither loads, links nor contact balance.
Loads that follow the boundary, such as a pressure, are those on the deformed one. Links and contact
respond to v as in an increment: contact may close, open and slip.

D is the elastic stiffness, and where plastic strain grew since the state before the tangent of one
increment that ends there and has half of this plastic strain p, in the direction of the last
increment, or where this is elastic in that of p. A change x of p along its direction meets the
hardening only. Across it, stress stays parallel to the flow if it changes by ``|dev T| dx/d|p|``.
What small strain neglects grows with the square of the deformation, so x as the square of p:
dx/d|p| = 2 x / |p|. Flow has the stiffness ``2 |dev T| / |p|`` across p, in series with the elastic
one: that of such an increment by the backward Euler method.

Links that rotate a body by w stretch it by ln(1 + w^2) / 2, because its displacements are linear. v
removes this stretch: it includes -ln(1 + w^2) / 2 times the position relative to the centre of
rotation.

The estimated share is the energy norm of s over that of T, the largest so far. If it is larger, the
norm of s + N - T is used, the change of nominal stress: under prescribed displacements it is the
error of forces.

C. Miehe, N. Apel, M. Lambrecht, Comput. Methods Appl. Mech. Engrg 191 (2002) 5383-5425: plasticity
in the space of logarithmic strain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from solver.audit.plain import GHOST, LEAST, PlainBody
from solver.audit.theory import Neglected
from solver.contact.candidates import find_candidates, no_candidates
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation
from solver.fem.large import Follower, Spinning, following
from solver.fem.rigid import RigidPart, turning
from solver.fem.substructure import Substructure
from solver.linear.schur import Eliminated
from solver.linear.solvers import Singular
from solver.loading.step import newton_step
from solver.materials import PlasticState
from solver.materials.elasticity import Elasticity
from solver.tensors import SQRT2, to_tensor
from solver.typing import Array

_FEW = 0.01
"""Elastic energy of a body, over that of all bodies: errors refer to at least this energy."""
_FAINT = 1e-5
"""Tensile stress over Young's modulus: errors refer to at least the energy of this stress."""
_STIFF = 1e-5
"""Least stiffness of points that flow, over the elastic one: without hardening a body may be a
mechanism, which rounding moves. A tenth of it, or ten times as much, change estimates by 2 %."""
_LITTLE = 1e-3
"""Plastic strain since the state before, over the elastic strain, up to which a point is elastic:
one that is loaded again to where it flowed does so by rounding."""
_FLAT = 1e-6
"""Least stretch; inverted elements count as flat."""


def large_strain(
    system: System, plain: Sequence[PlainBody], states: Iterable[Converged]
) -> Neglected:
    """Return the largest estimate of a body in the states of a path.

    Elements of large strain neglect nothing. Bodies of which all have it respond, next to others,
    as their elastic stiffness.
    """
    if all(body.body.large_elements.all() for body in plain):
        return Neglected()
    found = Neglected()
    bodies: Sequence[_Deformed | None] = [None] * len(plain)
    turned = np.zeros(len(system.links))
    for converged in sorted(states, key=_flowed):
        each = zip(plain, bodies, strict=True)
        bodies = now = [_Deformed(system, body, converged, before) for body, before in each]
        back, turned = turned, _turned(system, converged.state)
        _add(system, converged, now, turned - back)
        found = _largest([found, _worst(now, LEAST**2 * converged.energy.scale)])
    return found


def _flowed(converged: Converged) -> float:
    """Return the sum of accumulated plastic strain: it orders a path, but where nothing flows."""
    return float(sum(plastic.accumulated.sum() for plastic in converged.state.plastic))


def _largest(each: Iterable[Neglected]) -> Neglected:
    """Return the largest share; NaN is larger than all numbers."""
    return max(each, key=lambda one: np.nan_to_num(one.share, nan=np.inf), default=Neglected())


def _neglected(share: float, body: str) -> Neglected:
    if math.isnan(share):
        return Neglected(
            share,
            f"what small-strain theory neglects in the stress of {body} cannot be estimated: "
            "nothing balances the forces that large strain would add, reduce the load",
        )
    return Neglected(
        share,
        f"equilibrium in the deformed configuration and logarithmic strain would change the stress "
        f"of {body} by {share:.0%}: small-strain theory neglects this, reduce the load",
    )


def of_material(
    body: str, elasticity: Elasticity, stress: Array, strain: Array, volume: Array
) -> Neglected:
    """Return the norm of N - T over that of T: the estimate for rotations as small as strains.

    Parameters
    ----------
    stress, strain : (n_components, n_points) Mandel, stress in MPa
    volume : (n_points,) volume of the points [mm3]
    """
    changed, own = (
        float(elasticity.energy_density(each) @ volume)
        for each in (_nominal(stress, strain), stress)
    )
    return _neglected(math.sqrt(changed / own) if own else 0.0, body)


def _worst(bodies: Sequence[_Deformed], least: float) -> Neglected:
    """Return the largest norm of added stress over that of the stress, of all bodies."""
    least = max(_FEW * sum(body.most for body in bodies), least)
    changed = [max(b.energy(b.added), b.energy(b.added + b.nominal)) for b in bodies]
    levels = [max(body.most, least, body.faint) for body in bodies]
    ratios = [
        _neglected(math.sqrt(energy / level), body.name)
        for body, energy, level in zip(bodies, changed, levels, strict=True)
        if level
    ]
    return _largest(ratios)


class _Deformed:
    """A body in a state: its stress, and its changes by large strain.

    Attributes
    ----------
    stress : T (4, n_points), Mandel [MPa]
    added : s (4, n_points), Mandel, at first that of the state ``before`` [MPa]
    nominal : N - T (4, n_points), Mandel [MPa]
    force : nodal forces (n,) of R N - T, less the change of loads that follow the boundary [N]
    strain : E - e (4, n_points), Mandel
    since : its change since the state ``before``
    volume : (n_points,) volume of the points [mm3], zero near singular points, where removed, and
        where strain is large
    most : elastic energy of T, also where strain is large, the largest so far [N mm]
    plastic : internal variables
    loads : loads that would follow the body, made once for all states
    tangent : response with the tangent D; None where the body has its elastic stiffness
    """

    def __init__(
        self, system: System, plain: PlainBody, converged: Converged, before: _Deformed | None
    ) -> None:
        self.name, state = plain.body.name, converged.state
        self.number, self.part = system.part(self.name), plain.part
        self.elasticity, self._stiffness = plain.body.law.elasticity, plain.body.law.stiffness(4)
        if isinstance(system.parts[self.number], Discretisation):
            self.stress, _, plastic, _ = converged.responses[self.number]
        else:
            found = system.state(self.name, converged)
            self.stress, plastic = found.stress, found.plastic
        self.plastic = plastic
        known = plain.remaining(state.time) > GHOST
        for point in system.model.singular:
            known &= ~point.reaches(plain.points)
        large, volume = plain.body.large_elements, plain.volume.ravel()
        counts = known & ~np.repeat(large, plain.volume.shape[1])
        self.volume = np.where(counts, volume, 0.0)
        self.added: Array = np.zeros_like(self.stress) if before is None else before.added
        own = self.elasticity.energy_density(self.stress) @ np.where(known, volume, 0.0)
        self.most: float = max(float(own), 0.0 if before is None else before.most)
        self.tangent: PartResponse | None = None
        if large.all():
            self.force = np.zeros(self.part.n)
            self.nominal = self.strain = self.since = np.zeros_like(self.stress)
            return

        u = system.displacement(self.name, state)
        H, hoop = plain.gradient(u)
        T = plain.level(self.stress.reshape(4, *hoop.shape))
        e = _mandel((H + H.swapaxes(0, 1)) / 2, hoop)
        change = _nominal(T, e)
        R = turning(np.arctan2(H[1, 0] - H[0, 1], 2 + H[0, 0] + H[1, 1]))
        change[:, large] = 0.0
        turned = _product(R, _matrix(T + change)[:2, :2]) - _matrix(T)[:2, :2]
        turned[:, :, large] = 0.0
        self.force = plain.nominal_forces(turned, change[2]).ravel()
        loads = before.loads if before else following(self.part)
        self.loads: list[Follower | Spinning] = [
            load for load in loads if not plain.body.turns(load.load)
        ]
        for load in self.loads:
            self.force -= load.change(u, state.time)
        self.nominal = change.reshape(4, -1)
        change = _mandel(_logarithm(H), np.log(np.maximum(1 + hoop, _FLAT))) - e
        self.strain = np.where(counts, plain.level(change).reshape(4, -1), 0.0)
        self.since = self.strain if before is None else self.strain - before.strain
        if isinstance(system.parts[self.number], Discretisation):
            self._flow(converged, self.part.virgin() if before is None else before.plastic)

    def _flow(self, converged: Converged, before: PlasticState) -> None:
        """Set the tangent of points that flow, with one increment over half of their flow.

        Its direction is that of the last increment, or where this is elastic that of the plastic
        strain since the state ``before``.
        """
        state, u = converged.state, converged.state.u[self.number]
        now, last = (each.plastic[self.number] for each in (state, converged.start))
        grown, least = (now.accumulated - each.accumulated for each in (before, last))
        elastic = np.linalg.norm(self.stress, axis=0) / self.elasticity.youngs_modulus
        grown, least = (np.where(grown > _LITTLE * elastic, each, 0.0) for each in (grown, least))
        stiff = np.asarray(self.part.law(state.time).stiff)
        if not (grown.any() or (stiff != 1).any()):
            return
        back = np.divide(np.maximum(grown / 2, least), least, out=np.zeros_like(least),
                         where=least > 0)  # fmt: skip
        half = now.packed - back * (now.packed - last.packed)
        stopped = (grown > 0) & (least <= 0)
        half[:, stopped] = (now.packed + before.packed)[:, stopped] / 2
        with np.errstate(all="ignore"):  # a law may have no response to a state on this line
            found = self.part.respond(u, now.unpacked(half), state.time)
        flows = (grown > 0) & np.isfinite(found.law.tangent).all(axis=(0, 1))
        C = self._stiffness[:, :, None] * stiff
        D = np.where(flows, found.law.tangent + _STIFF * (C - found.law.tangent), C)
        changed = np.broadcast_to(flows | (stiff != 1), flows.shape)
        self.tangent = found._replace(law=found.law._replace(tangent=D, yielding=changed))

    def stressed(self, strain: Array) -> Array:
        """Return the stress (4, n_points) of a small change of strain [MPa]."""
        if self.tangent is None:
            return self._stiffness @ strain
        return np.einsum("abp,bp->ap", self.tangent.law.tangent, strain)

    @property
    def faint(self) -> float:
        """Elastic energy of the least stress to which errors refer [N mm]."""
        return float(_FAINT**2 * self.elasticity.youngs_modulus / 2 * self.volume.sum())

    def energy(self, stress: Array) -> float:
        """Return the elastic energy of a stress (4, n_points), with ``volume`` [N mm]."""
        return float(self.elasticity.energy_density(stress) @ self.volume)


def _add(system: System, converged: Converged, bodies: Sequence[_Deformed], motion: Array) -> None:
    """Add the stress since the state before: bodies, links and contact respond as in an increment.

    ``motion`` (c,) is what linked boundaries move by besides, see `_turned` [mm].
    """
    state, start = converged.state, converged.start
    system = system.during(start)
    own, begun = [np.zeros(part.n) for part in system.parts], list[Eliminated]()
    for body in bodies:
        body.added = body.added + body.stressed(body.since)
        force = -body.force - body.part.undeformed.internal_force(body.added)
        part = system.parts[body.number]
        condensed = part.begin(force) if isinstance(part, Substructure) else None
        begun.append(condensed or Eliminated(force, lambda u: u))
        own[body.number] = begun[-1].condensed
    path = state.contacts, state.links, state.time - start.time
    kept = no_candidates(system, state.u, state.links)
    touching = kept if converged.separated else find_candidates(system, start, state.u, *path)
    flows, step = {body.number: body.tangent for body in bodies}, None
    with suppress(Singular):
        operators = [
            inverse.tangent(flow, 0.0) if (flow := flows.get(k)) else inverse.elastic
            for k, inverse in enumerate(system.operators)
        ]
        for each in (touching, kept):  # contact forces are kept where no others balance the change
            change = each.motion.copy()
            change[each.linked] -= motion
            here = replace(each, motion=change, turning=None)
            forces = tuple(force - here.all_on_part(k, here.forces) for k, force in enumerate(own))
            step = step or newton_step(system, forces, operators, here, state.time)
    for body, back in zip(bodies, begun, strict=True):
        u = back.finish(step.u[body.number]) if step else np.full(body.part.n, np.nan)
        body.added = body.added + body.stressed(body.part.strain(u))


def _turned(system: System, state: State) -> Array:
    """Return the motions (c,) of links that remove the stretch of their linear rotations [mm].

    A linked boundary rotated by w has the displacements w J (X - c), and I + w J stretches by
    sqrt(1 + w^2). This is no strain of the true rotation, so the boundary moves back by it.
    """
    links, found = system.links, np.zeros(len(system.links))
    for k, link in enumerate(system.model.links):
        if link.rigid is None or system.full(link.slave[0]).body.turned_by(link):
            continue
        number, reference = system.part(link.slave[0]), system.part(link.rigid)
        part, rigid, rows = system.parts[number], system.parts[reference], links.rows[number]
        assert isinstance(rigid, RigidPart) and rows is not None
        slave = system.full(link.slave[0]).chain(link.slave[1], any_shape=link.master is None)
        stretch = math.log1p(rigid.motion_of(state.u[reference]).rotation ** 2) / 2
        back = np.zeros(part.n)
        back[part.surface(slave).dofs] = stretch * (rigid.frame.centre[:, None] - slave.X).T.ravel()
        found += np.where(links.whose == k, rows.block @ back[rows.dofs], 0.0)
    return found


def _product(one: Array, other: Array) -> Array:
    return np.einsum("ij...,jk...->ik...", one, other)


def _nominal(stress: Array, strain: Array) -> Array:
    """Return N - T = -(T e + e T) / 2 in Mandel components (n_components, ...) [MPa]."""
    product = _product(_matrix(stress), _matrix(strain))
    xy, yz, zx = (-(product[i, j] + product[j, i]) / 2 * SQRT2 for i, j in ((0, 1), (1, 2), (2, 0)))
    return np.stack([*(-product[k, k] for k in range(3)), xy, yz, zx])[: len(stress)]


def _matrix(mandel: Array) -> Array:
    """Return tensors (3, 3, ...) from Mandel components (n_components, ...)."""
    xx, yy, zz, xy, yz, zx = *to_tensor(mandel), *np.zeros((6 - len(mandel), *mandel.shape[1:]))
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def _mandel(plane: Array, hoop: Array) -> Array:
    """Return Mandel components (4, ...) from symmetric tensors (2, 2, ...) and their zz."""
    return np.array([plane[0, 0], plane[1, 1], hoop, SQRT2 * plane[0, 1]])


def _logarithm(H: Array) -> Array:
    """Return the logarithmic strain (2, 2, ...) of displacement gradients.

    C = (I + H)'(I + H) has the mean s and the deviator (d, o), with r = |(d, o)| and J^2 = det C;
    then ln(C) / 2 = ln(J) / 2 I + artanh(r / s) / (2 r) (d, o).
    """
    F = H + np.eye(2).reshape(2, 2, *[1] * (H.ndim - 2))
    C = _product(F.swapaxes(0, 1), F)
    s, d, o = (C[0, 0] + C[1, 1]) / 2, (C[0, 0] - C[1, 1]) / 2, C[0, 1]
    r, J = np.hypot(d, o), F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    mean, ratio = np.log(np.maximum(J, _FLAT)) / 2, np.minimum(r / s, 1 - _FLAT)
    share = np.divide(np.arctanh(ratio), 2 * r, out=1 / (2 * s), where=r > 0)
    return np.array([[mean + share * d, share * o], [share * o, mean - share * d]])
