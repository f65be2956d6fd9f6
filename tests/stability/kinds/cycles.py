"""Seeded loads that go back and forth: bars pulled and pushed, contacts that open and close.

A bar under uniform uniaxial stress follows the law in one dimension, solved here for the strain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import Body, Material, Model, System
from solver.contact.state import Converged
from solver.loading.outcome import PathEnded
from solver.loading.program import Control
from solver.loading.stepper import Stepper
from solver.mesh import grid
from tests.stability.kinds.reopening import beam, bend, judge
from tests.stability.trial import Figure, Scene, brief

COUNT = 4
SEED = 1886
CYCLES = 50
E, YIELD, LENGTH = 2e5, 300.0, 4.0
ELEMENTS = ("quad8", "quad4", "quad9", "tri6", "tri3")


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar in plane stress and the loads [MPa] that it is brought to, one after the other."""

    rule: str
    ratio: float
    fraction: float
    poisson_ratio: float
    element: str
    loads: tuple[float, ...]
    steps: int

    @property
    def material(self) -> Material:
        """Its law."""
        return Material(
            youngs_modulus=E,
            poisson_ratio=self.poisson_ratio,
            yield_stress=YIELD,
            hardening=self.rule,
            hardening_ratio=self.ratio,
            isotropic_fraction=self.fraction,
        )

    def strains(self) -> list[float]:
        """Return the strain along the bar at each load, by the law in one dimension."""
        H = E * self.ratio / (1 - self.ratio)
        share = {"isotropic": 1.0, "kinematic": 0.0}.get(self.rule, self.fraction)
        ep, back, path, out = 0.0, 0.0, 0.0, []
        for load in self.loads:
            beyond = abs(load - back) - YIELD - share * H * path
            if beyond > 0:
                flow = beyond / H
                way = math.copysign(flow, load - back)
                ep, back, path = ep + way, back + (1 - share) * H * way, path + flow
            out.append(load / E + ep)
        return out


@dataclass(frozen=True, kw_only=True)
class Pulled:
    """A bar at each of its loads."""

    bar: Bar
    system: System
    states: list[Converged]


def pull(bar: Bar) -> Pulled:
    """Bring the bar to its loads."""
    cells = "tri" if bar.element.startswith("tri") else "quad"
    body = Body(
        name="bar",
        mesh=grid(np.linspace(0, LENGTH, 3), np.linspace(0, 1, 3), cells),
        material=bar.material,
        element=bar.element,
        kinematics="plane_stress",
        supports={"left": "x", "bottom": "y"},
        pressure={"right": -1.0},
    )
    system = System(Model(bodies=(body,)))
    stepper = Stepper(system, Control())
    point = stepper.rest(system.initial())
    states, before = [], 0.0
    try:
        for load in bar.loads:
            for stop in np.linspace(before, load, bar.steps + 1)[1:]:
                point = stepper.reach(point, float(stop))
            states.append(point.now)
            before = load
    except PathEnded as ended:
        raise ended.error from ended
    return Pulled(bar=bar, system=system, states=states)


def judge_pulled(pulled: Pulled) -> dict[str, Figure]:
    """Return how far stress and elongation are from the law in one dimension, at any load."""
    bar, system = pulled.bar, pulled.system
    nodes = system.full("bar").boundary_nodes("right")
    stressed, moved = 0.0, 0.0
    wanted = bar.strains()
    largest = max(np.abs(wanted))
    for load, strain, converged in zip(bar.loads, wanted, pulled.states, strict=True):
        stress = system.state("bar", converged).stress
        off = np.abs(stress - np.array([load, 0.0, 0.0, 0.0])[:, None]).max()
        stressed = max(stressed, float(off) / YIELD)
        u = system.displacement("bar", converged.state)[2 * nodes]
        moved = max(moved, float(np.abs(u - LENGTH * strain).max()) / (LENGTH * largest))
    # a force balanced to 1e-8 leaves as much stress, over the slope of hardening, at every load
    loads = len(bar.loads)
    return {
        "uniform stress": Figure(stressed, 1e-6),
        "elongation": Figure(moved, 1e-6 + 1e-9 * loads / bar.ratio),
    }


def random_bar(number: int, rng: np.random.Generator) -> Bar:
    """Return a bar under 50 cycles of growing, equal, falling or random loads."""
    ratio = float(10 ** rng.uniform(-4, -0.3))
    rule = ("isotropic", "kinematic", "mixed")[number % 3]
    # without a limit to strain: the largest plastic strain is about a tenth
    highest = YIELD + min(0.1 * E * ratio, 2 * YIELD)
    shape = rng.choice(["equal", "growing", "falling", "random"])
    share = {
        "equal": np.ones(2 * CYCLES),
        "growing": np.linspace(0.3, 1.0, 2 * CYCLES),
        "falling": np.linspace(1.0, 0.3, 2 * CYCLES),
        "random": rng.uniform(0.0, 1.0, 2 * CYCLES),
    }[str(shape)]
    low = float(rng.choice([-1.0, -0.5, 0.0]))
    ways = np.tile([1.0, low], CYCLES)
    return Bar(
        rule=rule,
        ratio=ratio,
        fraction=float(rng.random()),
        poisson_ratio=float(rng.choice([0.0, 0.3, 0.499])),
        element=ELEMENTS[number % 5],
        loads=tuple(float(v) for v in highest * share * ways),
        steps=int(rng.choice([1, 2])),
    )


def _opening(rng: np.random.Generator) -> Scene:
    """Return a beam that is bent onto a block and lifted off it, without friction."""
    gap, steps = float(rng.choice([0.0, *rng.uniform(0, 0.05, 2)])), int(rng.choice([1, 2, 5]))
    low = float(rng.choice([0.0, -1.0, -0.3]))
    return Scene(
        what=f"beam bent {CYCLES} times in {steps} steps from {low:g}, gap {gap:g}",
        run=partial(bend, beam(0.0, gap), steps, low, CYCLES),
        judge=partial(judge, low),
        in_loads=False,
    )


def _cycled(number: int, rng: np.random.Generator) -> Scene:
    if number % 3 == 2:
        return _opening(rng)
    bar = random_bar(number, rng)
    what = brief(bar).split("loads=")[0]
    return Scene(what=what, run=partial(pull, bar), judge=judge_pulled, in_loads=False)


def scenes(count: int = COUNT) -> list[Scene]:
    """Return bars and beams."""
    rng = np.random.default_rng(SEED)
    return [_cycled(number, rng) for number in range(count)]
