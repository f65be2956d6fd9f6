"""Bars, blocks and beams without hardening, just below and beyond their exact limit load.

A bar in plane stress carries Re, blocks in plane strain 2 Re / sqrt(3). A beam under a block of
pressure Re on the lower half of its end and a pull Re on the upper half is fully plastic; the
same stress everywhere along it, and two blocks bending about a plastic hinge, give the same
limit from below and above (W. Prager, P.G. Hodge, Theory of Perfectly Plastic Solids, 1951).
"""

from __future__ import annotations

from functools import partial

import numpy as np

from solver import Body, Material, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.closed import Column, contact_force, passed
from tests.stability.kinds.punch_oracle import law
from tests.stability.trial import Figure, Scene

YIELD = 300.0
IDEAL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=YIELD)
CONTROL = PathControl(load_step=0.1, unload_steps=2)
MESH_ALLOWANCE = 1 + 1e-6
"""All three fields of stress and of motion are in the meshes; the rest is tolerance."""


def _bar(load: float) -> Solution:
    bar = Body(
        name="bar",
        mesh=grid(np.linspace(0, 4, 5), np.linspace(0, 1, 3)),
        material=IDEAL,
        kinematics="plane_stress",
        supports={"left": "x", "bottom": "y"},
        pressure={"right": -YIELD},
    )
    return solve(Model(bodies=(bar,)), load=load, control=CONTROL)


def _blocks(load: float) -> Solution:
    limit = YIELD * 2 / np.sqrt(3)
    return Column(upper=IDEAL, lower=IDEAL, pressure=limit, state="plane_strain").solve(
        load, CONTROL
    )


def _beam(load: float) -> Solution:
    mesh = grid(np.linspace(0, 6, 7), np.linspace(0, 1, 5))
    right = np.asarray(mesh.boundaries["right"])
    middle = mesh.p[1, mesh.facets[:, right]].mean(axis=0)
    mesh = mesh.with_boundaries({"low": right[middle < 0.5], "high": right[middle > 0.5]})
    mesh = mesh.with_boundaries({"foot": lambda m: (m[0] < 1e-9) & (m[1] < 0.3)})
    beam = Body(
        name="beam",
        mesh=mesh,
        material=IDEAL,
        kinematics="plane_stress",
        supports={"left": "x", "foot": "y"},
        pressure={"low": YIELD, "high": -YIELD},
    )
    return solve(Model(bodies=(beam,)), load=load, control=CONTROL)


def judge(name: str, load: float, solution: Solution) -> dict[str, Figure]:
    """Return the figures of what is carried: equilibrium on affine motions, and the law."""
    figures = {"audit": passed(solution)}
    for body in solution.system.model.bodies:
        part = solution.system.full(body.name)
        found = [law(solution.system, body.name, c) for c in (solution.loaded, solution.unloaded)]
        for key in found[0]:
            before = figures.get(key, Figure(0.0, 1e-7)).value
            figures[key] = Figure(max([before, *(f[key] for f in found)]), 1e-7)
        stress = solution.system.state(body.name, solution.loaded).stress
        volume = part.weights.sum()
        # mean stress of a body is the virtual work of its loads on an affine motion
        along = 1 if name == "blocks" else 0
        limit = {"bar": YIELD, "blocks": -YIELD * 2 / np.sqrt(3), "beam": 0.0}[name]
        mean = stress[along] @ part.weights.ravel() / volume
        miss = abs(mean - load * limit) / YIELD
        figures["mean stress"] = Figure(
            max(miss, figures.get("mean stress", Figure(0.0, 0.0)).value), 1e-6
        )
        if name == "beam":
            # the moment of sigma_x over the length, against M L
            arm = part.points[1].ravel() - 0.5
            moment = (stress[0] * arm) @ part.weights.ravel() / 6.0
            figures["moment"] = Figure(abs(moment - load * YIELD / 4) / YIELD, 1e-6)
    if name == "blocks":
        force = load * YIELD * 2 / np.sqrt(3) * 5.0
        figures["contact force"] = Figure(abs(contact_force(solution) - force) / force, 1e-7)
    return figures


def scenes() -> list[Scene]:
    """Return loads below and beyond the limit."""
    loads = [("bar", _bar, load) for load in (0.9, 0.999, 1.001, 1.1)]
    loads += [("blocks", _blocks, load) for load in (0.999, 1.001)]
    loads += [("beam", _beam, load) for load in (0.99, 1.01)]
    return [
        Scene(
            what=f"{name} at {load:g} of its limit load",
            run=partial(run, load),
            judge=partial(judge, name, load),
            load=load,
            certain=MESH_ALLOWANCE,
            safe=1.0,
        )
        for name, run, load in loads
    ]
