"""The elements a body may be made of."""

from __future__ import annotations

from dataclasses import dataclass

from skfem import Element, ElementQuad1, ElementQuad2, ElementQuadS2, ElementTriP1, ElementTriP2

from solver.errors import ModelError


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementType:
    """A displacement element and how it is integrated.

    Attributes
    ----------
    element : scalar scikit-fem element
    cells : ``quad`` or ``tri``
    order : polynomial degree the default integration is exact for
    full_order : the same for full integration
    quadratic : whether edges carry a midside node
    mean_dilatation : whether the volumetric strain is averaged over the element (B-bar)
    """

    element: Element
    cells: str
    order: int
    full_order: int
    quadratic: bool
    mean_dilatation: bool = False


ELEMENTS: dict[str, ElementType] = {
    "quad8": ElementType(
        element=ElementQuadS2(), cells="quad", order=3, full_order=5, quadratic=True
    ),
    "quad9": ElementType(
        element=ElementQuad2(), cells="quad", order=5, full_order=5, quadratic=True
    ),
    "quad4": ElementType(
        element=ElementQuad1(),
        cells="quad",
        order=3,
        full_order=3,
        quadratic=False,
        mean_dilatation=True,
    ),
    "tri6": ElementType(element=ElementTriP2(), cells="tri", order=2, full_order=4, quadratic=True),
    "tri3": ElementType(
        element=ElementTriP1(), cells="tri", order=1, full_order=1, quadratic=False
    ),
}


def element_type(name: str) -> ElementType:
    """Return the element called ``name`` or raise `ModelError`."""
    try:
        return ELEMENTS[name]
    except KeyError:
        raise ModelError("element", name, "must be one of " + ", ".join(ELEMENTS)) from None
