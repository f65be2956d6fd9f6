"""Contacts that close and open twenty times: each time like the first."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import Body, ContactPair, Material, Model, PathControl, Solution, System, solve
from solver.contact.state import Converged
from solver.loading.outcome import PathEnded
from solver.loading.program import Control
from solver.loading.stepper import Stepper
from solver.mesh import grid
from tests.stability.balance import mean_gaps
from tests.stability.closed import QUICK, STEEL, passed
from tests.stability.trial import Figure, Scene

TIMES = 20


def beam(friction: float, gap: float, yield_stress: float = np.inf) -> Model:
    """Return a cantilever 20 long and 0.5 high over a block under its free end."""
    law = Material(
        youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=yield_stress,
        hardening="kinematic", hardening_ratio=0.1,
    )  # fmt: skip
    cantilever = Body(
        name="beam",
        mesh=grid(np.linspace(0, 20, 21), np.linspace(0, 0.5, 2)),
        material=law,
        condense=False,
        supports={"left": "xy"},
        pressure={"top": 1.0},
    )
    block = Body(
        name="block",
        mesh=grid(np.linspace(15, 22, 6), -gap + np.linspace(-2, 0, 3)),
        material=STEEL,
        supports={"bottom": "xy"},
    )
    pair = ContactPair(slave=("beam", "bottom"), master=("block", "top"), friction=friction)
    return Model(bodies=(cantilever, block), contacts=(pair,))


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """The states at the top and at the bottom of every cycle."""

    system: System
    up: list[Converged]
    down: list[Converged]


def bend(model: Model, steps: int, low: float, times: int = TIMES) -> Cycles:
    """Load the model and release it, again and again, without taking the bodies apart."""
    system = System(model)
    stepper = Stepper(system, Control())
    point = stepper.rest(system.initial())
    up, down = [], []
    try:
        for _ in range(times):
            for load in np.linspace(low, 1, steps + 1)[1:]:
                point = stepper.reach(point, float(load))
            up.append(point.now)
            for load in np.linspace(1, low, steps + 1)[1:]:
                point = stepper.reach(point, float(load))
            down.append(point.now)
    except PathEnded as ended:
        raise ended.error from ended
    return Cycles(system=system, up=up, down=down)


def judge(low: float, cycles: Cycles) -> dict[str, Figure]:
    """Return how far the last nineteen cycles are from the second, the law being elastic.

    Without friction each is the first again; with it the first alone may differ.
    """
    system = cycles.system
    (pair,) = system.model.contacts
    size = float(np.abs(system.displacement("beam", cycles.up[0].state)).max())
    level = float(cycles.up[0].state.contacts[0].normal.sum())
    figures = {"closed": Figure(float(level < 1.0), 0.0)}
    for name, states in (("up", cycles.up), ("down", cycles.down)):
        u = [system.displacement("beam", c.state) for c in states]
        N = [c.state.contacts[0].normal for c in states]
        figures |= {
            f"displacement {name}": Figure(max(np.abs(v - u[1]).max() for v in u[2:]) / size, 1e-6),
            f"forces {name}": Figure(max(np.abs(n - N[1]).max() for n in N[2:]) / level, 1e-6),
        }
        gaps = [mean_gaps(system, pair, 0, c) for c in states]
        gaps = [np.where(np.isfinite(g), g, 0.0) for g in gaps]
        products = [np.abs(n * g).max() for n, g in zip(N, gaps, strict=True)]
        figures[f"overlap {name}"] = Figure(max(-g.min() for g in gaps) / size, 1e-7)
        figures[f"complementarity {name}"] = Figure(max(products) / size / level, 1e-7)
    if low == 0:
        left = max(float(c.state.contacts[0].normal.max()) for c in cycles.down)
        figures["left over"] = Figure(left / level, 1e-7)
    return figures


def _repeated() -> list[Solution]:
    model = beam(0.0, 0.01, 300.0)
    return [solve(model, load=load, control=QUICK) for load in np.linspace(0.8, 1.2, TIMES)]


def judge_repeated(solutions: list[Solution]) -> dict[str, Figure]:
    """Return figures of solutions at growing loads: the force on the block grows with them."""
    force = [float(s.loaded.state.contacts[0].normal.sum()) for s in solutions]
    return {
        "audit": Figure(max(passed(s).value for s in solutions), 0.0),
        "growing": Figure(float(-min(np.diff(force))), 0.0),
    }


def receding(pressure: float) -> Model:
    """Return a long thin plate on a foundation, pressed over a short length in its middle."""
    mesh = grid(np.linspace(0, 20, 21), np.linspace(0, 1, 3))
    top = np.asarray(mesh.boundaries["top"])
    near = mesh.p[0, mesh.facets[:, top]].max(axis=0) < 2.5
    plate = Body(
        name="plate",
        mesh=mesh.with_boundaries({"pressed": top[near]}),
        material=STEEL,
        supports={"left": "x"},
        pressure={"pressed": pressure},
    )
    foundation = Body(
        name="foundation",
        mesh=grid(np.linspace(0, 30, 16), np.linspace(-10, 0, 6)),
        material=STEEL,
        supports={"left": "x", "bottom": "y"},
    )
    pair = ContactPair(slave=("plate", "bottom"), master=("foundation", "top"))
    return Model(bodies=(plate, foundation), contacts=(pair,))


def _recede() -> tuple[Solution, Solution]:
    fine = PathControl(load_step=1 / TIMES, unload_steps=TIMES)
    return solve(receding(1.0), control=QUICK), solve(receding(1e3), control=fine)


def judge_receding(solutions: tuple[Solution, Solution]) -> dict[str, Figure]:
    """Return figures: a receding contact has one width at every load, and stress in proportion."""
    light, heavy = solutions
    N = [light.loaded.state.contacts[0].normal, heavy.loaded.state.contacts[0].normal / 1e3]
    return {
        "audit": Figure(max(passed(s).value for s in solutions), 0.0),
        "contact force": Figure(float(abs(N[1].sum() - 2.0) / 2.0), 1e-7),
        "proportion": Figure(float(np.abs(N[0] - N[1]).max() / N[0].sum()), 1e-7),
        "receded": Figure(float(N[0][-1] > 0 and N[0][0] > 0), 0.0),
    }


def scenes() -> list[Scene]:
    """Return bent beams and a receding contact."""
    cycles = ((0.0, 0.02, 5, 0.0), (0.3, 0.02, 4, 0.0), (0.0, 0.0, 3, 0.0))
    return [
        Scene(
            what=f"beam bent {TIMES} times in {steps} steps, friction {mu:g}, gap {gap:g}",
            run=partial(bend, beam(mu, gap), steps, low),
            judge=partial(judge, low),
            in_loads=False,
        )
        for mu, gap, steps, low in cycles
    ] + [
        Scene(what="yielding beam, load by load", run=_repeated, judge=judge_repeated),
        Scene(what="plate that recedes", run=_recede, judge=judge_receding),
    ]
