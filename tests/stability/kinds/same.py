"""One boundary, or a part of it, named as both sides of a contact: refused."""

from __future__ import annotations

from functools import partial

import numpy as np

from solver import Body, ContactPair, Model, solve
from solver.mesh import grid
from tests.stability.closed import STEEL
from tests.stability.trial import Scene, tells


def _solve(master: str, friction: float, sliding: str) -> object:
    mesh = grid(np.linspace(0, 4, 5), np.linspace(0, 2, 3))
    top = np.asarray(mesh.boundaries["top"])
    block = Body(
        name="block",
        mesh=mesh.with_boundaries({"half_of_top": top[: len(top) // 2]}),
        material=STEEL,
        supports={"bottom": "xy"},
        pressure={"right": 10.0},
    )
    pair = ContactPair(
        slave=("block", "top"), master=("block", master), friction=friction, sliding=sliding
    )
    return solve(Model(bodies=(block,), contacts=(pair,)))


def scenes() -> list[Scene]:
    """Return a boundary against itself, and against half of itself."""
    return [
        Scene(
            what=f"block's top against its {master}, friction {friction:g}, {sliding} sliding",
            run=partial(_solve, master, friction, sliding),
            refusal=tells("block", "top", "slave|master"),
        )
        for master, friction, sliding in (("top", 0.0, "small"), ("half_of_top", 0.3, "finite"))
    ]
