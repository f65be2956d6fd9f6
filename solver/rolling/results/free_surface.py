"""Stress at a free surface without extrapolation.

Recovered nodal stress is extrapolated to the surface from the integration points of the first
elements. This is wrong if flow begins within an element. Two values need no extrapolation:

- the stress at the first row of integration points, a small distance below the surface;
- the stress from the conditions of a free surface. With t along the surface and n normal to it
  ``sigma_nn = sigma_tn = 0``. Hooke's law for the other two components is then biaxial and does
  not contain the strain normal to the surface:

      e_t = eps_t - ep_t,   e_z = eps_z - ep_z
      sigma_t = E / (1 - nu^2) (e_t + nu e_z)
      sigma_z = E / (1 - nu^2) (e_z + nu e_t)

  ``eps_t`` follows from the displacements of the edge; ``eps_z`` is 0 in plane strain and
  ``u_r / r`` in axisymmetry. In plane stress sigma_z = 0 and sigma_t = E e_t. The plastic strain
  ``ep`` is taken from the first row, so the error is of first order in the side of the element:
  E / (1 - nu^2) times the change of ``ep_t + nu ep_z`` from the surface to that row.

If plastic strain is constant or zero below the surface, as after free rolling, both values are much
better than the nodal one. If it varies, strain and plastic strain belong to different depths, and
the free-surface value is the worst of the three: a difference of 1e-3 is 220 MPa in steel. This
happens under a braked wheel, where the value of the first row is best, and in a bore that yielded,
where stress is smooth and the nodal value is best.

Both are taken in columns: a point of the first row and its foot, the point of the edge with the
same coordinate along it. The derivative of a quadratic displacement is one order more accurate at
the two Gauss points of the edge than elsewhere. The 2 x 2 points of an eight-node quadrilateral
have their columns exactly there; other integration rules do not, and lose this order.

References
----------
J. Barlow, Int. J. Numer. Meth. Engng 10 (1976) 243-251: points of most accurate strain in elements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.fem.discretisation import Discretisation
from solver.fem.nodes import vectors
from solver.fem.surface import edges_of
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.tensors import SQRT2
from solver.typing import Array, Ints

_ONE_ROW = 1e-6
"""Points are in one row if their reference coordinates differ by less (rounding of the rules)."""


@dataclass(frozen=True, slots=True)
class FreeSurface:
    """Columns of integration points below a boundary, along x.

    Attributes
    ----------
    part : the body
    nodes : (n, 2 or 3) nodes of the edge above a column: start, end (, middle)
    N : (n, 2 or 3) shape functions of the edge at the foot of the column
    dN : (n, 2 or 3) their derivatives along the edge [1/mm]
    X : (2, n) feet of the columns, in the order of the first coordinate [mm]
    tangent : (2, n) unit vectors along the edge, with the body on the left
    points : (n,) indices of the points of the first row
    depth : (n,) depth of these points below the edge [mm]
    """

    part: Discretisation
    nodes: Ints
    N: Array
    dN: Array
    X: Array
    tangent: Array
    points: Ints
    depth: Array

    @classmethod
    def of(cls, part: Discretisation, boundary: str) -> FreeSurface:
        """Return the columns below a named boundary of a body."""
        edges = edges_of(part, boundary)
        element = part.body.mesh.f2t[0, part.body.facets(boundary)]
        corners = part.basis.mesh.t.shape[0]
        known = part.basis.element_dofs[:corners, element]
        reference = np.asarray(part.basis.elem.doflocs, dtype=float)
        a, b = (reference[(known == edges[:, k]).argmax(axis=0)] for k in (0, 1))
        # reference coordinates of the points, along each edge from its start and across it
        along, offset = (b - a).T[:, :, None], np.asarray(part.basis.X)[:, None] - a.T[:, :, None]
        length = (along**2).sum(axis=0)
        xi = 2 * (along * offset).sum(axis=0) / length - 1
        across = np.abs(along[0] * offset[1] - along[1] * offset[0]) / np.sqrt(length)
        edge, point = np.nonzero(across < across.min(axis=1, keepdims=True) + _ONE_ROW)
        nodes, xi = edges[edge], xi[edge, point]
        points = element[edge] * part.weights.shape[1] + point
        N, dN = (f(xi, edges.shape[1]) for f in (shape_functions, shape_derivatives))
        X = np.einsum("cni,ni->cn", part.X[:, nodes], N)
        t = np.einsum("cni,ni->cn", part.X[:, nodes], dN)
        stretch = np.hypot(*t)
        tangent = t / stretch
        down = part.points.reshape(2, -1)[:, points] - X
        depth = tangent[0] * down[1] - tangent[1] * down[0]
        o = np.argsort(X[0])
        dN = dN / stretch[:, None]
        return cls(part, nodes[o], N[o], dN[o], X[:, o], tangent[:, o], points[o], depth[o])

    def first_row(self, mandel: Array) -> Array:
        """Return components t and z (2, n) of a Mandel stress or strain (4, n_points)."""
        xx, yy, zz, xy = mandel[:, self.points]
        tx, ty = self.tangent
        return np.stack([tx**2 * xx + ty**2 * yy + SQRT2 * tx * ty * xy, zz])

    def strain(self, u: Array) -> Array:
        """Return components t and z (2, n) of strain at the surface for displacements [mm]."""
        nodal = vectors(u, 2).T[self.nodes]
        along = np.einsum("nic,ni,cn->n", nodal, self.dN, self.tangent)
        if self.part.body.kinematics != "axisymmetric":
            return np.stack([along, np.zeros_like(along)])
        return np.stack([along, (nodal[:, :, 0] * self.N).sum(axis=1) / self.X[0]])

    def stress(self, u: Array, plastic_strain: Array) -> Array:
        """Return components t and z (2, n) of stress at the free surface [MPa].

        Parameters
        ----------
        u : (n_unknowns,) displacements [mm]
        plastic_strain : (4, n_points) Mandel
        """
        elasticity = self.part.body.material.elasticity
        elastic = self.strain(u) - self.first_row(plastic_strain)
        if self.part.body.kinematics == "plane_stress":
            return np.stack([elasticity.youngs_modulus * elastic[0], np.zeros_like(elastic[0])])
        return elasticity.biaxial_stress(elastic)

    def at(self, x: float, values: Array) -> Array:
        """Return values (..., n) of the columns at ``x`` [mm], linear between the nearest two."""
        flat = np.atleast_2d(values)
        found = np.array([np.interp(x, self.X[0], each) for each in flat])
        return found.reshape(values.shape[:-1])
