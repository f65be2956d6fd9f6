"""Stress intensities at a tip: by an interaction integral with the near field, and by faces.

With the field of a mode of intensity one, marked *, and q that falls from one at the tip to zero:

I = int (s_ij u*_i,1 + s*_ij u_i,1 - s*:e d_1j) q_,j - e0:(s* q),1 dA - int t_i u*_i,1 q ds
  - int b_i u*_i,1 q dA,  K = E' I / 2

where e is the elastic strain, e0 the strain of heat and initial stress, b the force per volume and
t the traction on the faces. The term of e0 is integrated by parts: e0 need not be smooth. A
constant e0 adds nothing; its value at the tip is subtracted: the integrand stays integrable.

References
----------
J.F. Yau, S.S. Wang, H.T. Corten, J. Appl. Mech. 47 (1980) 335-341; C.F. Shih, R.J. Asaro, J. Appl.
Mech. 55 (1988) 299-316. Displacements: S.K. Chan, I.S. Tuba, W.K. Wilson, Eng. Fract. Mech. 2
(1970) 1-17.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solver.fem.nodes import Nodes
from solver.fem.surface import edges_of
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.mesh.opening import faces_of
from solver.tensors import to_tensor
from solver.typing import Array, Bools, Ints

_POINTS = np.polynomial.legendre.leggauss(8)
Forces = Callable[[Array, Array, Ints], Array]
"""Forces (2, n_edges, n_points) on a face per depth of the body, of positions and pieces of edges
along which the body is on the left (2, n_edges, n_points), and of the edges (n_edges, 3)."""


class AtPoints(NamedTuple):
    """What a body has at its points, components xx, yy, zz, xy first (4, n_elements, n_points).

    Attributes
    ----------
    u : (n_nodes, 2) displacements [mm]
    stress, elastic : stress [MPa] and elastic strain
    eigenstrain : strain of heat and of initial stress
    body_force : (2, n_elements, n_points) force per volume [N/mm3]
    """

    u: Array
    stress: Array
    elastic: Array
    eigenstrain: Array
    body_force: Array


def by_integral(
    tip: Tip, field: AtPoints, elastic: PlaneElasticity, q: Array, forces: tuple[Forces, Forces]
) -> Array:
    """Return K_I and K_II (2,) [MPa sqrt(mm)] of a domain q (n_nodes,); see the module.

    ``forces`` are those on the upper and the lower face. On the faces of a quarter-point element
    u*_,1 ~ 1/sqrt(r) times the length of a piece is smooth.
    """
    basis, part = tip.part.basis, tip.part
    own = np.flatnonzero(q[basis.element_dofs].any(axis=0))
    nodes = basis.element_dofs[:, own]
    slopes = np.array([b[0].grad[:, own] for b in basis.basis])
    shapes = np.array([np.broadcast_to(b[0], basis.dx.shape)[own] for b in basis.basis])
    area = basis.dx[own]
    R = tip.axes
    u_1 = np.einsum("ab,neb,ncep,c->aep", R, field.u[nodes], slopes, R[0])
    q_j = np.einsum("jc,ncep,ne->jep", R, slopes, q[nodes])
    q_at = np.einsum("nep,ne->ep", shapes, q[nodes])
    stress, strain, given = (_turned(each[:, own], R) for each in field[1:4])
    force = np.tensordot(R, field.body_force[:, own], 1)
    r, angle = tip.polar(part.points[:, own])
    given = given - given.reshape(4, -1)[:, r.argmin()].reshape(4, 1, 1)
    found = []
    for mode in (0, 1):
        near = near_tip(r, angle, mode, elastic)
        flux = _dot(stress, near.moved_x) + _dot(near.stress, u_1)
        flux[0] -= _contracted(near.stress, strain)
        density = (flux * q_j).sum(axis=0)
        density -= _contracted(near.stress_x * q_at + near.stress * q_j[0], given)
        density -= (force * near.moved_x).sum(axis=0) * q_at
        total = float((density * area).sum())
        for edges, at, acting in zip(tip.edges, (np.pi, -np.pi), forces, strict=True):
            total -= _of_face(tip, edges, at, mode, elastic, q, acting)
        found.append(total * elastic.modulus / 2)
    return np.array(found)


def _of_face(
    tip: Tip, edges: Ints, angle: float, mode: int, elastic: PlaneElasticity, q: Array,
    forces: Forces,
) -> float:  # fmt: skip
    """Return the integral of t_i u*_i,1 q along a face, per depth of the body."""
    edges = edges[q[edges].any(axis=1)]
    xi, weights = _POINTS
    X = tip.part.X[:, edges]
    shape = shape_functions(xi, 3)
    x, along = X @ shape.T, X @ shape_derivatives(xi, 3).T * weights
    r, _ = tip.polar(x)
    moved = near_tip(r, np.full(r.shape, angle), mode, elastic).moved_x
    acting = np.tensordot(tip.axes, forces(x, along, edges), 1)
    return float(((acting * moved).sum(axis=0) * (q[edges] @ shape.T)).sum())


def by_displacements(tip: Tip, u: Array, elastic: PlaneElasticity) -> Array:
    """Return K_I and K_II (2,) [MPa sqrt(mm)] of the displacements (n_nodes, 2) of the faces.

    Opening and sliding at a quarter of the edges at the tip and at their ends have two terms,
    sqrt(r) and r^(3/2).
    """
    upper, lower = (edges[0] for edges in tip.edges)
    length = np.hypot(*(tip.part.X[:, upper[1]] - tip.part.X[:, upper[0]]))
    apart = [u[upper[2]] - u[lower[2]], u[upper[0]] - u[lower[1]]]
    along, across = tip.axes @ (8 * apart[0] - apart[1]) / 3
    scale = elastic.shear / (elastic.kappa + 1) * np.sqrt(2 * np.pi / length)
    return np.array([across, along]) * scale


def tensor(mandel: Array, shape: tuple[int, int]) -> Array:
    """Return tensor components (4, n_elements, n_points) of a Mandel vector (4, n)."""
    return to_tensor(mandel).reshape(4, *shape)


def _turned(tensor: Array, R: Array) -> Array:
    """Return components xx, yy, zz, xy (4, ...) in axes R (2, 2)."""
    full = np.array([[tensor[0], tensor[3]], [tensor[3], tensor[1]]])
    full = np.einsum("ai,bj,ij...->ab...", R, R, full)
    return np.stack([full[0, 0], full[1, 1], tensor[2], full[0, 1]])


def _dot(tensor: Array, vector: Array) -> Array:
    """Return the product (2, ...) of a tensor, xx, yy, zz, xy, and a vector."""
    xx, yy, _, xy = tensor
    return np.stack([xx * vector[0] + xy * vector[1], xy * vector[0] + yy * vector[1]])


def _contracted(one: Array, other: Array) -> Array:
    """Return the double contraction (...) of tensors xx, yy, zz, xy."""
    return np.asarray((one[:3] * other[:3]).sum(axis=0) + 2 * one[3] * other[3])


class PlaneElasticity(NamedTuple):
    """Elastic constants in the plane.

    Attributes
    ----------
    shear : shear modulus G [MPa]
    kappa : 3 - 4 nu in plane strain, (3 - nu) / (1 + nu) in plane stress
    across : zz over xx + yy of stress: nu in plane strain, 0 in plane stress
    """

    shear: float
    kappa: float
    across: float

    @classmethod
    def of(cls, youngs_modulus: float, nu: float, *, plane_stress: bool) -> PlaneElasticity:
        """Return the constants of an isotropic material."""
        kappa = (3 - nu) / (1 + nu) if plane_stress else 3 - 4 * nu
        return cls(youngs_modulus / (2 + 2 * nu), kappa, 0.0 if plane_stress else nu)

    @property
    def modulus(self) -> float:
        """E / (1 - nu^2) in plane strain, E in plane stress: K^2 over it is the energy released."""
        return 8 * self.shear / (1 + self.kappa)


class NearTip(NamedTuple):
    """The field at n places for a stress intensity of one; x is ahead of the tip.

    Attributes
    ----------
    stress : (4, n) components xx, yy, zz, xy
    stress_x : (4, n) its derivative along x
    moved_x : (2, n) derivative of the displacement along x
    """

    stress: Array
    stress_x: Array
    moved_x: Array


def near_tip(r: Array, angle: Array, mode: int, elastic: PlaneElasticity) -> NearTip:
    """Return the field of mode I (0) or II (1) at polar coordinates from -pi to pi.

    With z = r exp(i angle) and f = K / (2 sqrt(2 pi z)), K = 1 or -i, complex potentials are
    phi' = f and psi' = conj(f)(z) - f - z f', where conj(f)(z) is -f of mode II:

    xx + yy = 4 Re f,  yy - xx + 2 i xy = 2 (conj(z) f' + psi')
    2 G d(u + i v)/dx = kappa f - conj(f) - z conj(f') - conj(psi')

    References
    ----------
    N.I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, Noordhoff
    (1953); M.L. Williams, J. Appl. Mech. 24 (1957) 109-114.
    """
    shear, kappa, across = elastic
    sign, K = ((1.0, 1.0), (-1.0, -1j))[mode]
    z = r * np.exp(1j * angle)
    f = K / (2 * np.sqrt(2 * np.pi * r) * np.exp(0.5j * angle))
    f1, f2 = -f / (2 * z), 3 * f / (4 * z**2)
    psi, psi1 = sign * f - f - z * f1, sign * f1 - 2 * f1 - z * f2
    moved = (kappa * f - f.conj() - z * f1.conj() - psi.conj()) / (2 * shear)
    stress, stress_x = (
        _components(4 * s.real, 2 * d, across)
        for s, d in ((f, z.conj() * f1 + psi), (f1, f1 + z.conj() * f2 + psi1))
    )
    return NearTip(stress, stress_x, np.stack([moved.real, moved.imag]))


def _components(total: Array, apart: Array, across: float) -> Array:
    """Return xx, yy, zz, xy from xx + yy and yy - xx + 2 i xy."""
    xx, yy = (total - apart.real) / 2, (total + apart.real) / 2
    return np.stack([xx, yy, across * total, apart.imag / 2])


class Tip(NamedTuple):
    """A tip of a crack.

    Attributes
    ----------
    name : that of the body and the crack, and ``start`` or ``end`` if it has two tips
    crack : name of the crack
    part : the body
    vertex, at : vertex of its mesh, and position (2,) [mm]
    ahead : (2,) unit vector in which the crack would go on
    edges : edges (n, 3) of its upper and its lower face, upper to the left of ``ahead``; the first
        of each is that at the tip
    others : vertices of the other tips of the body
    """

    name: str
    crack: str
    part: Nodes
    vertex: int
    at: Array
    ahead: Array
    edges: tuple[Ints, Ints]
    others: Ints

    @property
    def axes(self) -> Array:
        """Unit vectors (2, 2) of its own axes: ahead, and to the left of it."""
        x, y = self.ahead
        return np.array([[x, y], [-y, x]])

    def polar(self, X: Array) -> tuple[Array, Array]:
        """Return distance and angle from ahead of positions (2, ...)."""
        x, y = np.tensordot(self.axes, X - self.at.reshape(2, *(1,) * (X.ndim - 1)), 1)
        return np.hypot(x, y), np.arctan2(y, x)

    def domain(self, rings: int) -> tuple[Array, int]:
        """Return a function that falls from one at the tip to zero, by nodes, and its rings.

        It is one at the corners of so many rings of elements around the tip; of fewer if these
        reached the outline, another crack or another tip, and of none if there is no room.
        """
        mesh, basis = self.part.body.mesh, self.part.basis
        barred = np.zeros(mesh.nvertices, dtype=bool)
        barred[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), self.facets)]] = True
        inside, done = np.arange(mesh.nvertices) == self.vertex, 0
        for _ in range(rings):
            wider = _grown(mesh.t, inside)
            if (wider & barred).any() or _grown(mesh.t, wider)[self.others].any():
                break
            inside, done = wider, done + 1
        values = np.zeros(self.part.X.shape[1])
        values[basis.nodal_dofs[0]] = inside if done else 0.0
        values[basis.facet_dofs[0]] = inside[mesh.facets].mean(axis=0) if done else 0.0
        return values, done

    @property
    def sides(self) -> set[tuple[str, str]]:
        """Its faces, by body and boundary."""
        return {(self.part.body.name, face) for face in faces_of(self.crack)}

    @property
    def facets(self) -> Ints:
        """The facets of both faces."""
        return np.concatenate([self.part.body.facets(face) for _, face in self.sides])


def _grown(t: Ints, inside: Bools) -> Bools:
    """Return which vertices belong to an element that has one of some vertices."""
    wider = np.zeros_like(inside)
    wider[t[:, inside[t].any(axis=0)]] = True
    return wider


def tips_of(part: Nodes) -> list[Tip]:
    """Return the tips of all cracks of a body."""
    vertex = np.zeros(part.X.shape[1], dtype=int)
    vertex[part.basis.nodal_dofs[0]] = np.arange(part.body.mesh.nvertices)
    found: list[Tip] = []
    for crack in part.body.cracks:
        left, right = (edges_of(part, face) for face in faces_of(crack))
        nodes = np.intersect1d(left[:, :2], right[:, :2])
        for node in nodes:
            # the body is on the left of an edge: the upper face ends at the tip
            at_end = bool((left[:, 1] == node).any())
            upper, lower = (
                _from_tip(e, node) for e in ((left, right) if at_end else (right, left))
            )
            along = part.X[:, node] - part.X[:, upper[0, 0]]
            end = (".end" if at_end else ".start") if len(nodes) > 1 else ""
            found.append(Tip(
                f"{part.body.name}.{crack}{end}", crack, part, int(vertex[node]), part.X[:, node],
                along / np.hypot(*along), (upper, lower), np.zeros(0, dtype=int),
            ))  # fmt: skip
    every = np.array([tip.vertex for tip in found], dtype=int)
    return [tip._replace(others=every[every != tip.vertex]) for tip in found]


def _from_tip(edges: Ints, node: int) -> Ints:
    """Return the edges, that at a node first."""
    return edges[np.argsort(~(edges[:, :2] == node).any(axis=1), kind="stable")]
