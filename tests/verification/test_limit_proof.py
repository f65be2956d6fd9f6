"""Which structures have a limit load: two bars of 3 and 2 mm behind one rigid end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import (
    Body,
    ContactPair,
    LimitLoad,
    Link,
    Material,
    Model,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    solve,
)
from solver.mesh import grid
from solver.model.rigid import line

SOFT = Material(youngs_modulus=7e4, poisson_ratio=0.0, yield_stress=120.0)
ELASTIC = Material(youngs_modulus=2.1e5, poisson_ratio=0.0)
IDEAL = replace(ELASTIC, yield_stress=200.0)
FORCE = 1500.0
LIMIT = 120.0 * 3 + 200.0 * 2


def bar(name: str, material: Material, y: tuple[float, float], size: float) -> Body:
    """Return a bar 40 mm long, held on its left."""
    x = np.linspace(0.0, 40.0, round(40 / size) + 1)
    mesh = grid(x, np.linspace(*y, max(2, round((y[1] - y[0]) / size)) + 1))
    return Body(name=name, mesh=mesh, material=material, kinematics="plane_stress",
                supports={"left": "x", "bottom": "y"} if y[0] < 0 else {"left": "x"})  # fmt: skip


def bars(stiff: Material, joined: str, force: float = FORCE) -> Model:
    """Return the soft bar on the stiff one, both moved by a rigid end.

    ``joined`` are links to the end, with ties of each other ("slave" is the soft one, "master" the
    stiff one) or without ("apart"), or contact with an end that presses ("pressed").
    """
    fine = 1.3 if joined == "slave" else 1.0
    u, low = bar("u", SOFT, (0.0, 3.0), 2.3 - fine), bar("l", stiff, (-2.0, 0.0), fine)
    tied = {"slave": (Link(slave=("u", "bottom"), master=("l", "top")),),
            "master": (Link(slave=("l", "top"), master=("u", "bottom")),)}  # fmt: skip
    if joined not in tied:
        u = replace(u, supports={"left": "x", "bottom": "y"})
    if joined == "pressed":
        plate = line((40.0, 4.0), (40.0, -4.0), 8)
        end = RigidBody(name="end", surfaces={"face": plate}, x=Pushed(value=-force))
        pairs = tuple(ContactPair(slave=(b, "right"), master=("end", "face"), friction=0.0)
                      for b in ("u", "l"))  # fmt: skip
        return Model(bodies=(u, low), rigid=(end,), contacts=pairs)
    end = RigidBody(name="end", centre=(40.0, 0.0), x=Pushed(value=force))
    ends = tuple(Link(slave=(b, "right"), rigid="end", components="x") for b in ("u", "l"))
    return Model(bodies=(u, low), rigid=(end,), links=ends + tied.get(joined, ()))


def solved(model: Model, steps: int) -> Solution:
    return solve(model, stages=[Stage(name="pulled", target=1.0, steps=steps)])


@pytest.mark.parametrize("steps", [1, 5, 30])
@pytest.mark.parametrize("joined", ["slave", "master", "apart", "pressed"])
def test_a_bar_beside_an_elastic_one_has_no_limit_load(joined: str, steps: int) -> None:
    """The soft one carries its 360 N, the elastic one the rest."""
    found = solved(bars(ELASTIC, joined), steps)
    sign = -1 if joined == "pressed" else 1
    for name, exact in (("u", 120.0), ("l", (FORCE - 360.0) / 2)):
        stress = found.system.state(name, found.stages["pulled"]).stress
        assert np.abs(sign * stress[0] - exact).max() < 1e-3
        assert np.abs(stress[1:]).max() < 1e-3


@pytest.mark.parametrize("joined", ["slave", "apart", "pressed"])
def test_two_ideal_bars_have_one(joined: str) -> None:
    with pytest.raises(LimitLoad, match="flows around") as caught:
        solved(bars(IDEAL, joined), 5)
    assert caught.value.reached * FORCE < LIMIT * 1.0001
    assert LIMIT * 0.999 < caught.value.attempted * FORCE < LIMIT * 1.05


@pytest.mark.parametrize(
    "material",
    [
        replace(ELASTIC, youngs_modulus=210.0),
        replace(IDEAL, hardening="isotropic", hardening_ratio=1e-3),
    ],
    ids=["weak", "hardening"],
)
def test_little_stiffness_is_no_limit_load(material: Material) -> None:
    """However weak the second bar is, or little it hardens, it carries the rest."""
    found = solved(bars(material, "slave"), 2)
    stress = found.system.state("l", found.stages["pulled"]).stress
    assert np.abs(stress[0] - (FORCE - 360.0) / 2).max() < 0.1
