"""Estimate of the error of small-strain theory: the stress that large strain would add.

Let T be the stress of a converged state, H the displacement gradient and e its symmetric part, the
strain. A theory of large strain differs in two ways.

1. Equilibrium holds in the deformed configuration. T rotates with the material by R, the rotation
   of I + H, and acts on stretched areas: its nominal stress is R N, with N = T - (T e + e T) / 2.
2. The strain is logarithmic, E = ln((I + H)'(I + H)) / 2. For a body that rotates, the same linear
   displacements give a stretch in E - e of about half the square of the angle.

The estimate is the smallest stress s with which T + s satisfies both. With the elastic stiffness C,
the stiffness K of the bodies joined by their links, and their strain operator B,

    s = C (E - e + x + B v),   K v = -f(R N - T) - f(C (E - e + x))

where f are nodal forces. Forces of loads and contact are those of T. The displacements v relax the
strains that the bodies are free to relax, such as the shortening of a beam that bends. In yielded
material E - e is left out, and x is the plastic strain with the least energy of s, by conjugate
gradients; elsewhere x is zero. x does not change the part of s that f(R N - T) causes, which no
stress with less energy balances. Links that rotate a body by w stretch it by ln(1 + w^2) / 2,
because its displacements are linear. v removes this stretch: it includes -ln(1 + w^2) / 2 times the
position relative to the centre of rotation.

The estimated share is the energy norm of s over that of T. If it is larger, the norm of s + N - T
is used, the change of nominal stress: under prescribed displacements it is the error of forces.

C. Miehe, N. Apel, M. Lambrecht, Comput. Methods Appl. Mech. Engrg 191 (2002) 5383-5425: plasticity
in the space of logarithmic strain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from solver.audit.plain import GHOST, LEAST, PlainBody
from solver.audit.theory import Neglected
from solver.contact.candidates import no_candidates
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.rigid import RigidPart, turning
from solver.fem.substructure import Substructure
from solver.linear.schur import Eliminated
from solver.loading.step import newton_step
from solver.materials.elasticity import Elasticity
from solver.tensors import SQRT2, to_tensor
from solver.typing import Array

_FEW = 0.01
"""Elastic energy of a body, over that of all bodies: errors refer to at least this energy."""
_FAINT = 1e-5
"""Tensile stress over Young's modulus: errors refer to at least the energy of this stress."""
_SURE = 0.01
"""Estimate up to which plastic strain is not computed: it can only reduce the estimate."""
_STEPS, _SETTLED = 20, 1e-5
"""Most conjugate gradients. Energy of the residual over that of the stress: they end below it."""
_FLAT = 1e-6
"""Least stretch; inverted elements count as flat."""


def large_strain(
    system: System, plain: Sequence[PlainBody], states: Iterable[Converged]
) -> Neglected:
    """Return the largest estimate of a body in some states of a system.

    Bodies of large strain neglect nothing; next to others they respond as their elastic stiffness.
    """
    if all(body.body.large for body in plain):
        return Neglected()
    return _largest(_in_state(system, plain, state) for state in states)


def _largest(each: Iterable[Neglected]) -> Neglected:
    """Return the largest share; NaN is larger than all numbers."""
    return max(each, key=lambda one: np.nan_to_num(one.share, nan=np.inf), default=Neglected())


def _neglected(share: float, body: str) -> Neglected:
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


def _in_state(system: System, plain: Sequence[PlainBody], converged: Converged) -> Neglected:
    bodies = [_Deformed(system, body, converged) for body in plain]
    joined, least = _Joined(system, converged, bodies), LEAST**2 * converged.energy.scale
    added = joined.stress(joined.strain, [each.force for each in bodies])
    found = _worst(bodies, joined.each(added), least)
    if found.share > _SURE and joined.yielded.any():
        found = _worst(bodies, joined.each(added + joined.relaxing()), least)
    return found


def _worst(bodies: Sequence[_Deformed], added: Sequence[Array], least: float) -> Neglected:
    """Return the largest norm of added stress over that of the stress, of all bodies."""
    own = [each.energy(each.stress) for each in bodies]
    least = max(_FEW * sum(own), least)
    changed = [
        max(body.energy(s), body.energy(s + body.nominal))
        for body, s in zip(bodies, added, strict=True)
    ]
    levels = [max(T, least, body.faint) for body, T in zip(bodies, own, strict=True)]
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
    nominal : N - T (4, n_points), Mandel [MPa]
    force : nodal forces (n,) of R N - T [N]
    yielded : (n_points,) whether the material has yielded
    strain : E - e (4, n_points), Mandel, zero where it has yielded
    volume : (n_points,) volume of the points [mm3], zero near singular points and where removed
    """

    def __init__(self, system: System, plain: PlainBody, converged: Converged) -> None:
        self.name, state = plain.body.name, converged.state
        self.number, self.part = system.part(self.name), plain.part
        self.elasticity, self.stiffness = plain.body.law.elasticity, plain.body.law.stiffness(4)
        if isinstance(system.parts[self.number], Discretisation):
            self.stress, _, plastic, _ = converged.responses[self.number]
        else:
            found = system.state(self.name, converged)
            self.stress, plastic = found.stress, found.plastic
        self.yielded = plastic.accumulated > 0
        counts = plain.remaining(state.time) > GHOST
        for point in system.model.singular:
            counts &= ~point.reaches(plain.points)
        counts &= not plain.body.large
        self.volume = np.where(counts, plain.volume.ravel(), 0.0)
        if plain.body.large:
            self.force = np.zeros(self.part.n)
            self.nominal = self.strain = np.zeros_like(self.stress)
            return

        H, hoop = plain.gradient(system.displacement(self.name, state))
        T = plain.level(self.stress.reshape(4, *hoop.shape))
        e = _mandel((H + H.swapaxes(0, 1)) / 2, hoop)
        change = _nominal(T, e)
        R = turning(np.arctan2(H[1, 0] - H[0, 1], 2 + H[0, 0] + H[1, 1]))
        turned = _product(R, _matrix(T + change)[:2, :2]) - _matrix(T)[:2, :2]
        self.force = plain.nominal_forces(turned, change[2]).ravel()
        self.nominal = change.reshape(4, -1)
        change = _mandel(_logarithm(H), np.log(np.maximum(1 + hoop, _FLAT))) - e
        self.strain = np.where(~counts | self.yielded, 0.0, plain.level(change).reshape(4, -1))

    @property
    def faint(self) -> float:
        """Elastic energy of the least stress to which errors refer [N mm]."""
        return float(_FAINT**2 * self.elasticity.youngs_modulus / 2 * self.volume.sum())

    def energy(self, stress: Array) -> float:
        """Return the elastic energy of a stress (4, n_points), with ``volume`` [N mm]."""
        return float(self.elasticity.energy_density(stress) @ self.volume)


class _Joined:
    """The elastic bodies of a system, joined by their links, under the changes by large strain.

    Points are those of all bodies, one after the other: strain (4, n_points), yielded (n_points,).
    """

    def __init__(self, system: System, converged: Converged, bodies: Sequence[_Deformed]) -> None:
        self._system, self._bodies = system.during(converged.start), bodies
        state = converged.state
        apart = no_candidates(self._system, state.u, np.zeros_like(state.links))
        self._links = replace(apart, motion=-_turned(self._system, state))
        self._ends = np.cumsum([len(each.yielded) for each in bodies])
        self.yielded = np.concatenate([each.yielded for each in bodies])
        self.strain = np.hstack([each.strain for each in bodies])

    def each(self, values: Array) -> list[Array]:
        """Return the values (..., n_points) of each body."""
        return np.split(values, self._ends[:-1], axis=-1)

    def stress(
        self, strain: Array, forces: Sequence[Array] | None = None, *, turned: bool = True
    ) -> Array:
        """Return the stress (4, n_points) that an eigenstrain and nodal forces cause [MPa].

        ``forces`` (n,) of each body act with the opposite sign. If ``turned``, linked boundaries
        also move by the motions of `_turned`.
        """
        parts, strains = self._system.parts, self.each(strain)
        own, begun = [np.zeros(part.n) for part in parts], []
        for k, (body, each) in enumerate(zip(self._bodies, strains, strict=True)):
            force = -body.part.undeformed.internal_force(body.stiffness @ each)
            part, force = parts[body.number], force if forces is None else force - forces[k]
            condensed = part.begin(force) if isinstance(part, Substructure) else None
            begun.append(condensed or Eliminated(force, lambda u: u))
            own[body.number] = begun[-1].condensed
        operators = [each.elastic for each in self._system.operators]
        links = self._links
        links = links if turned else replace(links, motion=np.zeros_like(links.motion))
        step = newton_step(self._system, tuple(own), operators, links)
        if step is None:  # stress is not finite
            return np.full_like(strain, np.nan)
        return np.hstack(
            [
                body.stiffness @ (each + body.part.strain(back.finish(step.u[body.number])))
                for body, back, each in zip(self._bodies, begun, strains, strict=True)
            ]
        )

    def relaxing(self) -> Array:
        """Return the stress of the plastic strain x with which the energy of s is least [MPa].

        It is found by conjugate gradients. The stress of x balances itself, so the energy of s is
        least if that of the stress of ``E - e + x`` is least. The elastic strain of the residual is
        the preconditioned gradient.
        """
        given = self.stress(self.strain)
        made, way, last = np.zeros_like(given), np.zeros_like(given), np.inf
        level = _SETTLED * sum(2 * each.energy(each.stress) for each in self._bodies)
        volumes = np.concatenate([each.part.volumes for each in self._bodies])
        for _ in range(_STEPS):
            residual = np.where(self.yielded, -(given + made), 0.0)
            elastic = zip(self._bodies, self.each(residual), strict=True)
            down = np.hstack([body.elasticity.strain(r) for body, r in elastic])
            now = float((residual * down).sum(axis=0) @ volumes)
            if not now > level:
                break
            way = down + now / last * way
            along = self.stress(way, turned=False)
            made += now / float((way * along).sum(axis=0) @ volumes) * along
            last = now
        return made


def _turned(system: System, state: State) -> Array:
    """Return the motions (c,) of links that remove the stretch of their linear rotations [mm].

    A linked boundary rotated by w has the displacements w J (X - c), and I + w J stretches by
    sqrt(1 + w^2). This is no strain of the true rotation, so the boundary moves back by it.
    """
    links, found = system.links, np.zeros(len(system.links))
    for k, link in enumerate(system.model.links):
        if link.rigid is None:
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
