"""A second, plain evaluation of a body: strain, nodal forces, applied forces, elastic energy.

Nothing here uses the operators that increments are solved with: gradients come from the elements
themselves, volumes from the quadrature, and the resultants of pressures from the shape of the
boundary. Stress and strain are Mandel vectors, elements and points last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.fem.surface import edges_of
from solver.mesh.elements import element_type
from solver.mesh.shapes import shape_functions
from solver.model.loads import Pressure, Traction
from solver.tensors import SQRT2, to_tensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.discretisation import Discretisation
    from solver.model.body import Body

    Array = NDArray[np.float64]


_CHORDS = 64
"""Chords of a curved edge."""


@dataclass(frozen=True)
class PlainBody:
    """One meshed body; ``part`` gives nodes, elements and quadrature."""

    part: Discretisation

    @property
    def body(self) -> Body:
        """What was declared."""
        return self.part.body

    @cached_property
    def _nodes(self) -> NDArray[np.int64]:
        return np.asarray(self.part.same[self.part.basis.element_dofs])

    @cached_property
    def _gradients(self) -> Array:
        """(n_element_nodes, 2, n_elements, n_points) [1/mm]."""
        return np.array([np.asarray(b[0].grad) for b in self.part.basis.basis])

    @property
    def steepest(self) -> float:
        """Largest strain of an element if one of its nodes moves by a unit [1/mm]."""
        return float(np.abs(self._gradients).max())

    @cached_property
    def _round(self) -> Array:
        """Hoop strain of unit radial displacements (n_element_nodes, n_elements, n_points)."""
        radius = self.part.basis.global_coordinates()[0]
        return np.array([np.asarray(b[0]) / radius for b in self.part.basis.basis])

    @cached_property
    def volume(self) -> Array:
        """Volume of the points (n_elements, n_points) [mm3]."""
        return np.asarray(self.part.basis.dx * self._depth(self.part.basis.global_coordinates()))

    def _depth(self, x: Array) -> Array:
        round_axis = self.body.kinematics == "axisymmetric"
        return np.asarray(2 * np.pi * x[0] if round_axis else self.body.thickness)

    @property
    def _averaged(self) -> bool:
        """Whether the volumetric strain of an element is the mean over its points."""
        kind = element_type(self.body.element)
        return kind.mean_dilatation and self.body.kinematics != "plane_stress"

    def _level(self, field: Array) -> Array:
        """Return a tensor field with its trace averaged over each element, where that applies."""
        if not self._averaged:
            return field
        trace = field[:3].sum(axis=0)
        mean = (trace * self.volume).sum(axis=1) / self.volume.sum(axis=1)
        out = field.copy()
        out[:3] += (mean[:, None] - trace) / 3
        return out

    def strain(self, u: Array) -> Array:
        """Return Mandel strain (4, n_elements, n_points) for displacements (n,) [mm]."""
        at = u.reshape(-1, 2)[self._nodes]  # (n_element_nodes, n_elements, 2)
        xx = np.einsum("iep,ie->ep", self._gradients[:, 0], at[..., 0])
        yy = np.einsum("iep,ie->ep", self._gradients[:, 1], at[..., 1])
        xy = np.einsum("iep,ie->ep", self._gradients[:, 1], at[..., 0])
        xy += np.einsum("iep,ie->ep", self._gradients[:, 0], at[..., 1])
        zz = np.zeros_like(xx)
        if self.body.kinematics == "axisymmetric":
            zz = np.einsum("iep,ie->ep", self._round, at[..., 0])
        return self._level(np.array([xx, yy, zz, xy / SQRT2]))

    def forces(self, stress: Array) -> Array:
        """Return the nodal forces (n_nodes, 2) that balance a Mandel stress (4, n_points) [N]."""
        tensor = to_tensor(stress).reshape(4, *self.volume.shape)
        weighted = self._level(tensor) * self.volume
        G = self._gradients
        x = np.einsum("iep,ep->ie", G[:, 0], weighted[0])
        x += np.einsum("iep,ep->ie", G[:, 1], weighted[3])
        y = np.einsum("iep,ep->ie", G[:, 1], weighted[1])
        y += np.einsum("iep,ep->ie", G[:, 0], weighted[3])
        if self.body.kinematics == "axisymmetric":
            x += np.einsum("iep,ep->ie", self._round, weighted[2])
        count = self.part.X.shape[1]
        nodes = self._nodes.ravel()
        return np.stack([np.bincount(nodes, f.ravel(), count) for f in (x, y)], axis=1)

    def applied(self, time: float) -> Array:
        """Return the resultant (2,) of pressures and tractions at a time [N].

        A pressure p on a chord from A to B pushes with p times the depth and the length of AB,
        against its normal; a traction with the depth and the length. Curved edges have many chords.
        """
        total = np.zeros(2)
        for load in self.body.every_load:
            if not isinstance(load, Pressure | Traction):
                continue
            edges = self.part.X[:, edges_of(self.part, load.boundary)]
            places = np.linspace(-1.0, 1.0, 1 + (_CHORDS if edges.shape[-1] > 2 else 1))
            points = edges @ shape_functions(places, edges.shape[-1]).T
            along = np.diff(points, axis=-1)
            depth = self._depth((points[..., 1:] + points[..., :-1]) / 2)
            if isinstance(load, Pressure):
                force = load.value * np.array([-along[1], along[0]])
            else:
                force = np.multiply.outer([load.x, load.y], np.linalg.norm(along, axis=0))
            total += load.factor(time) * (depth * force).sum(axis=(1, 2))
        return total

    def elastic_energy(self, stress: Array, time: float) -> float:
        """Return the energy of a Mandel stress (4, n_points) at a time [N mm]."""
        density = self.part.law(time).energy_density(stress)
        return float((density * self.volume.ravel()).sum())
