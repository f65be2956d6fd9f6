"""Bars under 1.1 times their yield load that hardly harden: large strain, and no limit.

``eps = sigma / E + (sigma - Re) / H`` with the plastic modulus ``H = E r / (1 - r)``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from solver import Body, Material, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.closed import Column, contact_force, passed, stress_miss, uniaxial
from tests.stability.kinds.stacks import Layer, Stack
from tests.stability.trial import Figure, Scene

E, YIELD, LOAD, LENGTH = 2e5, 300.0, 1.1, 4.0
CONTROL = PathControl(load_step=0.25, unload_steps=2)


def _material(rule: str, ratio: float) -> Material:
    return Material(
        youngs_modulus=E,
        poisson_ratio=0.3,
        yield_stress=YIELD,
        hardening=rule,
        hardening_ratio=ratio,
    )


def _elongation(ratio: float) -> float:
    return LOAD * YIELD / E + (LOAD - 1) * YIELD * (1 - ratio) / (E * ratio)


def _pull(rule: str, ratio: float, element: str) -> Solution:
    cells = "tri" if element.startswith("tri") else "quad"
    bar = Body(
        name="bar",
        mesh=grid(np.linspace(0, LENGTH, 4), np.linspace(0, 1, 3), cells),
        material=_material(rule, ratio),
        element=element,
        kinematics="plane_stress",
        supports={"left": "x", "bottom": "y"},
        pressure={"right": -YIELD},
    )
    return solve(Model(bodies=(bar,)), load=LOAD, control=CONTROL)


def judge_pulled(ratio: float, solution: Solution) -> dict[str, Figure]:
    """Return the figures of a bar: the tolerance of the force, 1e-8, over Eu leaves 1e-7."""
    nodes = solution.system.full("bar").boundary_nodes("right")
    moved = solution.displacement("bar", "loaded")[0, nodes]
    wanted = LENGTH * _elongation(ratio)
    stress = np.array([LOAD * YIELD, 0.0, 0.0, 0.0])
    return {
        "audit": passed(solution),
        "uniform stress": Figure(stress_miss(solution, "bar", stress), 1e-6),
        "elongation": Figure(float(np.abs(moved - wanted).max()) / wanted, 1e-5),
        "residual stress": Figure(
            stress_miss(solution, "bar", 0 * stress, "unloaded", YIELD), 1e-6
        ),
    }


def _press(rule: str, ratio: float) -> Solution:
    return _column(rule, ratio).solve(LOAD, CONTROL)


def _column(rule: str, ratio: float) -> Column:
    material = _material(rule, ratio)
    return replace(Column(), upper=material, lower=material, pressure=YIELD)


def judge_pressed(rule: str, ratio: float, solution: Solution) -> dict[str, Figure]:
    """Return the figures of two blocks of one material, one on the other."""
    column = _column(rule, ratio)
    force = LOAD * YIELD * column.area
    stress = uniaxial(column, -LOAD * YIELD)
    top = solution.system.full("upper").boundary_nodes("top")
    lowered = -solution.displacement("upper", "loaded")[1, top]
    wanted = sum(column.heights) * _elongation(ratio)
    miss = max(stress_miss(solution, body, stress) for body in ("upper", "lower"))
    return {
        "audit": passed(solution),
        "uniform stress": Figure(miss, 1e-6),
        "contact force": Figure(abs(contact_force(solution) - force) / force, 1e-7),
        "elongation": Figure(float(np.abs(lowered - wanted).max()) / wanted, 1e-5),
    }


def _spread(rule: str, ratio: float, friction: float) -> Scene:
    """Return a block on a wider one: the stress spreads, and is judged by balance alone."""
    material = _material(rule, ratio)
    return Stack(
        layers=(
            Layer(material=material, cells=(4, 3)),
            Layer(material=material, width=6.0, cells=(7, 3)),
        ),
        pressure=LOAD * YIELD,
        state="plane_stress",
        friction=friction,
        steps=10,
    ).scene()


def scenes() -> list[Scene]:
    """Return bars pulled, blocks of one width pressed, and a block pressed on a wider one."""
    pulled = (
        ("isotropic", 1e-6, "quad8"),
        ("kinematic", 1e-5, "quad4"),
        ("mixed", 1e-4, "tri6"),
    )
    pressed = (("kinematic", 1e-6), ("mixed", 1e-5), ("kinematic", 1e-3))
    return (
        [
            Scene(
                what=f"bar of {element} pulled, {rule} hardening {ratio:g}",
                run=partial(_pull, rule, ratio, element),
                judge=partial(judge_pulled, ratio),
            )
            for rule, ratio, element in pulled
        ]
        + [
            Scene(
                what=f"blocks pressed, {rule} hardening {ratio:g}",
                run=partial(_press, rule, ratio),
                judge=partial(judge_pressed, rule, ratio),
            )
            for rule, ratio in pressed
        ]
        + [_spread("mixed", 1e-6, 0.0), _spread("kinematic", 1e-5, 0.3)]
    )
