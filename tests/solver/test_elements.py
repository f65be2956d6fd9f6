"""Elements say what they are, and are refused where the solver cannot use them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from skfem import (
    Element,
    ElementLineP1,
    ElementQuadS2,
    ElementTriCR,
    ElementTriP1B,
    ElementTriP2,
    ElementTriP3,
)

from solver.errors import ModelError
from solver.mesh.elements import ELEMENTS, ElementType, add_element


def test_cells_and_sides_are_those_of_the_shape_functions() -> None:
    assert {name: (kind.cells, kind.quadratic) for name, kind in ELEMENTS.items()} == {
        "quad8": ("quad", True),
        "quad9": ("quad", True),
        "quad4": ("quad", False),
        "tri6": ("tri", True),
        "tri3": ("tri", False),
        "hex8": ("hex", False),
        "tet10": ("tet", True),
    }


@pytest.mark.parametrize(
    ("element", "allowed"),
    [
        (ElementLineP1(), "must be of triangles, quadrilaterals, tetrahedra or hexahedra"),
        (ElementTriP3(), "must have 3 or 6 nodes"),
        (ElementTriP1B(), "must have 3 or 6 nodes"),
        (ElementTriCR(), "must have 3 or 6 nodes"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Element) else "",
)
def test_an_element_of_other_nodes_is_refused(element: Element, allowed: str) -> None:
    with pytest.raises(ModelError, match=allowed):
        ElementType(element=element, order=2, full_order=2)


def test_an_element_whose_unknowns_are_no_values_is_refused() -> None:
    class Half(ElementQuadS2):  # type: ignore[misc]
        def lbasis(self, X, i):  # type: ignore[no-untyped-def]
            value, gradient = super().lbasis(X, i)
            return value / 2, gradient / 2

    with pytest.raises(ModelError, match="must have values at its nodes as unknowns"):
        ElementType(element=Half(), order=3, full_order=5)


def test_a_triangle_has_points_that_carry_a_polynomial() -> None:
    with pytest.raises(ModelError, match="order = 5: must be 1, 2 or 4 on a triangle"):
        ElementType(element=ElementTriP2(), order=5, full_order=4)


def test_a_name_has_one_element(monkeypatch: pytest.MonkeyPatch) -> None:
    own = replace(ELEMENTS["quad8"], order=5)
    monkeypatch.setitem(ELEMENTS, "mine", own)
    add_element("mine", replace(own, element=ElementQuadS2()))  # a file that is read twice
    with pytest.raises(ModelError, match="element = 'mine': is the name of another"):
        add_element("mine", replace(own, order=3))
    with pytest.raises(ModelError, match="element = 'quad8': is the name of another"):
        add_element("quad8", own)
