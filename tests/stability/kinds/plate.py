"""A plate of steel with any mesh, held at two sides and pulled at a third."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from solver import Body, Model, PathControl, Solution, solve
from tests.stability.closed import STEEL

if TYPE_CHECKING:
    from skfem import Mesh


def pull(make: Callable[[], Mesh], *, name: str, element: str, left: str) -> Solution:
    """Pull the plate at its right side; ``left`` are the components that its left side holds."""
    body = Body(
        name=name,
        mesh=make(),
        material=STEEL,
        element=element,
        kinematics="plane_stress",
        supports={"left": left, "bottom": "y"},
        pressure={"right": -10.0},
    )
    return solve(Model(bodies=(body,)), control=PathControl(load_step=1.0))
