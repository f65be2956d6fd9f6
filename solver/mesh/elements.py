"""Element types by name; new ones can be added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import skfem
from skfem.refdom import RefHex, RefQuad, RefTet, RefTri

from solver.errors import ModelError
from solver.parts import load_own_parts

_CELLS = {RefTri: "tri", RefQuad: "quad", RefTet: "tet", RefHex: "hex"}
_NODES = {"tri": (3, 6), "quad": (4, 8, 9), "tet": (4, 10), "hex": (8, 20)}
"""Permitted numbers of nodes: corners only, with sides, with the middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementType:
    """A displacement element and its integration.

    Attributes
    ----------
    element : scalar scikit-fem element whose unknowns are values at its nodes: 3 or 6 of a
        triangle, 4, 8 or 9 of a quadrilateral, 4 or 10 of a tetrahedron, 8 or 20 of a hexahedron
    order : polynomial degree up to which the default integration is exact
    full_order : the same for full integration
    mean_dilatation : whether the volumetric strain is averaged over the element (B-bar)
    """

    element: skfem.Element
    order: int
    full_order: int
    mean_dilatation: bool = False

    def __post_init__(self) -> None:
        shape = self.element
        name = type(shape).__name__
        if shape.refdom not in _CELLS:
            allowed = "must be of triangles, quadrilaterals, tetrahedra or hexahedra"
            raise ModelError("element", name, allowed)
        nodes = np.array(shape.doflocs, dtype=float).T
        counts = _NODES[self.cells]
        if nodes.shape[1] not in counts or shape.nodal_dofs != 1 or shape.facet_dofs > 1:
            allowed = f"must have {', '.join(map(str, counts[:-1]))} or {counts[-1]} nodes"
            raise ModelError("element", name, allowed)
        values = np.array([shape.lbasis(nodes, i)[0] for i in range(nodes.shape[1])])
        if not np.allclose(values, np.eye(nodes.shape[1])):
            raise ModelError("element", name, "must have values at its nodes as unknowns")
        for field in ("order", "full_order"):
            if self.cells == "tri" and getattr(self, field) not in (1, 2, 4):
                allowed = "must be 1, 2 or 4 on a triangle: stress recovery needs its points"
                raise ModelError(field, getattr(self, field), allowed)

    @property
    def cells(self) -> str:
        """``tri``, ``quad``, ``tet`` or ``hex``."""
        return _CELLS[self.element.refdom]

    @property
    def dim(self) -> int:
        """Number of axes: 2 in the plane, 3 in space."""
        return int(self.element.refdom.dim())

    @property
    def quadratic(self) -> bool:
        """Whether edges carry a midside node."""
        return bool(self.element.edge_dofs if self.dim == 3 else self.element.facet_dofs)


ELEMENTS: dict[str, ElementType] = {
    "quad8": ElementType(element=skfem.ElementQuadS2(), order=3, full_order=5),
    "quad9": ElementType(element=skfem.ElementQuad2(), order=5, full_order=5),
    "quad4": ElementType(element=skfem.ElementQuad1(), order=3, full_order=3, mean_dilatation=True),
    "tri6": ElementType(element=skfem.ElementTriP2(), order=2, full_order=4),
    "tri3": ElementType(element=skfem.ElementTriP1(), order=1, full_order=1),
    "hex8": ElementType(element=skfem.ElementHex1(), order=3, full_order=3, mean_dilatation=True),
    "tet10": ElementType(element=skfem.ElementTetP2(), order=2, full_order=4),
}
"""The elements by name."""


def add_element(name: str, kind: ElementType) -> None:
    """Add an element under its name, usually in a user's own file (see `solver.parts`).

    Raises
    ------
    ModelError
        if another element has this name
    """
    before = ELEMENTS.setdefault(name, kind)
    same = type(before.element) is type(kind.element)
    if not same or replace(before, element=kind.element) != kind:
        raise ModelError("element", name, "is the name of another element already")


def known_elements(dim: int | None = None) -> Mapping[str, ElementType]:
    """Return the elements of ``dim`` axes, or all, by name, with those of the user's own files."""
    load_own_parts()
    return {name: kind for name, kind in ELEMENTS.items() if dim in (None, kind.dim)}


def element_type(name: str) -> ElementType:
    """Return the element called ``name`` or raise `ModelError`."""
    known = known_elements()
    if name not in known:
        raise ModelError("element", name, "must be one of " + ", ".join(known))
    return known[name]
