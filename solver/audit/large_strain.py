"""Estimate of what small-strain theory leaves out: the stress that large strain would add.

Let T be the stress of a converged state, with H the displacement gradient and e its symmetric part,
the strain. A theory of large strain differs in two ways.

1. Balance holds in the deformed place. T turns with the material by R, the rotation of I + H, and
   acts on areas that have stretched: its nominal stress is R N, with N = T - (T e + e T) / 2.
2. The strain is the logarithmic one, E = ln((I + H)'(I + H)) / 2. It is that of the same
   displacements, so where a body turns E - e also has the stretch of its linear displacements,
   about half of the square of the angle.

The estimate is the stress s nearest to zero with which T + s fulfils both. With C the elastic
stiffness, K that of the bodies joined by their links, and B their strain operator,

    s = C (E - e + x + B v),   K v = -f(R N - T) - f(C (E - e + x))

where f are nodal forces. Forces of loads and contact are those of T. Thus the displacements v relax
what the body is free to relax, such as the shortening of a beam that bends. Where material has
yielded, E - e is left out, and x is the plastic strain with the least energy of s, by conjugate
gradients; elsewhere x is zero. It does not change the part of s that f(R N - T) causes, which no
stress with less energy balances. Linear displacements stretch a body that links turn by an angle
w, by ln(1 + w^2) / 2. v takes this back: it includes -ln(1 + w^2) / 2 times the position from the
centre of rotation.

The share is the energy norm of s over that of T, or that of s + N - T, the change of nominal
stress, where a displacement is prescribed and the force on it errs.

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
from solver.fem.frame import turning
from solver.fem.rigid import RigidPart
from solver.loading.step import newton_step
from solver.materials.elasticity import Elasticity
from solver.tensors import SQRT2, to_tensor
from solver.typing import Array

_FEW = 0.01
"""Least share of a body in the elastic energy of all; the stress of a body with less counts as that
of this energy."""
_FAINT = 1e-5
"""Tensile stress over Young's modulus; the stress of a body with less energy counts as this one."""
_SURE = 0.01
"""Estimate up to which plastic strain need not relax it: that can only make it smaller."""
_STEPS, _SETTLED = 20, 1e-5
"""Largest number of conjugate gradients; and the energy of what is left to relax, over that of the
stress, at which they end."""
_FLAT = 1e-6
"""Least stretch; elements that turn over are taken as flat."""


def large_strain(
    system: System, plain: Sequence[PlainBody], states: Iterable[Converged]
) -> Neglected:
    """Return the largest estimate of a body in some states of a system."""
    return _largest(_in_state(system, plain, state) for state in states)


def _largest(each: Iterable[Neglected]) -> Neglected:
    """Return the largest share; one that is no number is the largest of all."""
    return max(each, key=lambda one: np.nan_to_num(one.share, nan=np.inf), default=Neglected())


def _neglected(share: float, body: str) -> Neglected:
    return Neglected(
        share,
        f"balance in the deformed place and logarithmic strain would change the stress of {body} "
        f"by {share:.0%}: small-strain theory leaves that out, reduce the load",
    )


def of_material(
    body: str, elasticity: Elasticity, stress: Array, strain: Array, volume: Array
) -> Neglected:
    """Return the norm of N - T over that of T, where a body turns no more than it strains.

    Parameters
    ----------
    stress, strain : (n_components, n_points) Mandel [MPa]
    volume : (n_points,) of the points [mm3]
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
    """Return the largest ratio of the norm of added stresses to that of the stress of a body."""
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
    """A body in a state: its stress, and what large strain changes.

    Attributes
    ----------
    stress : T (4, n_points), Mandel [MPa]
    nominal : N - T (4, n_points), Mandel [MPa]
    force : nodal forces (n,) of R N - T [N]
    yielded : (n_points,) whether the material has yielded
    strain : E - e (4, n_points), Mandel, zero where it has yielded
    volume : (n_points,) of the points that count, away from singular points [mm3]
    """

    def __init__(self, system: System, plain: PlainBody, converged: Converged) -> None:
        self.name, state = plain.body.name, converged.state
        self.number, self.part = system.part(self.name), plain.part
        self.elasticity, self.stiffness = plain.body.law.elasticity, plain.body.law.stiffness(4)
        meshed = system.parts[self.number].meshed
        response = (
            converged.responses[self.number] if meshed else system.response(self.name, converged)
        )
        self.stress, self.yielded = response.stress, response.state.accumulated > 0
        counts = plain.left(state.time) > GHOST
        for point in system.model.singular:
            counts &= ~point.reaches(plain.points)
        self.volume = np.where(counts, plain.volume.ravel(), 0.0)

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
        """Elastic energy of the least stress that counts [N mm]."""
        return float(_FAINT**2 * self.elasticity.youngs_modulus / 2 * self.volume.sum())

    def energy(self, stress: Array) -> float:
        """Return the elastic energy of a stress (4, n_points) at the points that count [N mm]."""
        return float(self.elasticity.energy_density(stress) @ self.volume)


class _Joined:
    """The elastic bodies of a system, joined by their links, under what large strain changes.

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
        """Return the stress (4, n_points) that an eigenstrain, with forces, causes [MPa].

        Its nodal forces are minus those given (n,), of each body. What links hold moves from where
        small rotations of rigid bodies have it to where they have ``turned`` it.
        """
        parts, strains = self._system.parts, self.each(strain)
        own, begun = [np.zeros(part.n) for part in parts], []
        for k, (body, each) in enumerate(zip(self._bodies, strains, strict=True)):
            force = -body.part.undeformed.internal_force(body.stiffness @ each)
            begun.append(parts[body.number].begin(force if forces is None else force - forces[k]))
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
        """Return the stress of the plastic strain that leaves the least energy [MPa].

        Conjugate gradients for the plastic strain, where material has yielded. Its stress balances
        itself, so that it leaves the least energy of all where it leaves the least of the stress
        of ``E - e``. The elastic strain of the residual is the preconditioned gradient.
        """
        left = self.stress(self.strain)
        made, way, last = np.zeros_like(left), np.zeros_like(left), np.inf
        level = _SETTLED * sum(2 * each.energy(each.stress) for each in self._bodies)
        volumes = np.concatenate([each.part.volumes for each in self._bodies])
        for _ in range(_STEPS):
            residual = np.where(self.yielded, -(left + made), 0.0)
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
    """Return the motions (c,) that take from what links turn the stretch of linear rotation [mm].

    A boundary turned by w has the displacements w J (X - c), and I + w J stretches by
    sqrt(1 + w^2). The logarithm of that is no strain: what holds the boundary draws it back.
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
    """Return N - T = -(T e + e T) / 2 of Mandel components (n_components, ...) [MPa]."""
    product = _product(_matrix(stress), _matrix(strain))
    xy, yz, zx = (-(product[i, j] + product[j, i]) / 2 * SQRT2 for i, j in ((0, 1), (1, 2), (2, 0)))
    return np.stack([*(-product[k, k] for k in range(3)), xy, yz, zx])[: len(stress)]


def _matrix(mandel: Array) -> Array:
    """Return tensors (3, 3, ...) of Mandel components (n_components, ...)."""
    xx, yy, zz, xy, yz, zx = *to_tensor(mandel), *np.zeros((6 - len(mandel), *mandel.shape[1:]))
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def _mandel(plane: Array, hoop: Array) -> Array:
    """Return Mandel components (4, ...) of symmetric tensors (2, 2, ...) and their zz."""
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
