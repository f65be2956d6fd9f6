"""Stress intensities at a tip: by an interaction integral, and by displacements of the faces.

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

from solver.fracture.near_tip import PlaneElasticity, near_tip
from solver.fracture.tip import Tip
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.tensors import to_tensor
from solver.typing import Array, Ints

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
