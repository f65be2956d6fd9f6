"""Bars between two walls that move, heated and cooled: every course of both, with softening.

Stress is uniaxial: the law in one dimension, stepped here as the solver steps, is its answer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import (
    Amplitude,
    Body,
    Displacement,
    InitialStress,
    Material,
    Model,
    Solution,
    Stage,
    Temperature,
    solve,
)
from solver.mesh import grid
from tests.stability.trial import Figure, Scene, brief

COUNT = 6
SEED = 1824
E, YIELD, ALPHA = 2e5, 300.0, 1.2e-5
RULES = ("none", "isotropic", "kinematic", "mixed")
ELEMENTS = ("quad8", "quad4", "quad9", "tri6", "tri3")


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar in plane stress; strains of its length and rises of temperature at the stages' ends."""

    rule: str
    ratio: float
    poisson_ratio: float
    element: str
    size: float
    strains: tuple[float, ...]
    rises: tuple[float, ...]
    steps: int
    first: float
    drops: tuple[float, float]

    def solve(self) -> Solution:
        """Return the solution, a stage for each strain."""
        cells = "tri" if self.element.startswith("tri") else "quad"
        time = np.arange(len(self.strains) + 1.0)
        length = 4.0 * self.size
        moved = Displacement(
            boundary="right", x=length, amplitude=Amplitude(time, np.array([0.0, *self.strains]))
        )
        heat = Temperature(
            rise=1.0, expansion=ALPHA, modulus_drop=self.drops[0], yield_drop=self.drops[1],
            amplitude=Amplitude(time, np.array([0.0, *self.rises])),
        )  # fmt: skip
        made = InitialStress(stress=lambda x: np.outer([self.first, 0, 0, 0], np.ones(x.shape[1])))
        body = Body(
            name="bar",
            mesh=grid(np.linspace(0, length, 4), np.linspace(0, self.size, 3), cells),
            material=self.material,
            element=self.element,
            kinematics="plane_stress",
            supports={"left": "x", "bottom": "y"},
            loads=(moved, heat, *([made] if self.first else [])),
        )
        stages = [
            Stage(name=str(k), target=k + 1.0, steps=self.steps) for k in range(len(self.strains))
        ]
        return solve(Model(bodies=(body,)), stages=stages)

    @property
    def material(self) -> Material:
        """Its law, cold."""
        return Material(
            youngs_modulus=E, poisson_ratio=self.poisson_ratio, yield_stress=YIELD,
            hardening=self.rule, hardening_ratio=self.ratio,
        )  # fmt: skip

    def stresses(self) -> list[float]:
        """Return the stress at the end of each stage, by the law in one dimension."""
        H = E * self.ratio / (1 - self.ratio)
        share = {"isotropic": 1.0, "mixed": 0.5}.get(self.rule, 0.0)
        plastic, path, out = 0.0, 0.0, []
        strains, rises = (0.0, *self.strains), (0.0, *self.rises)
        for k in range(len(self.strains)):
            for part in np.arange(1, self.steps + 1) / self.steps:
                total, rise = (a[k] + part * (a[k + 1] - a[k]) for a in (strains, rises))
                soft, weak = 1 - self.drops[0] * rise, 1 - self.drops[1] * rise
                elastic = total - ALPHA * rise + self.first / E - plastic
                off = soft * (E * elastic - (1 - share) * H * plastic)
                beyond = abs(off) - weak * YIELD - soft * share * H * path
                if beyond > 0:
                    flow = math.copysign(beyond / (soft * (E + H)), off)
                    plastic, path, elastic = plastic + flow, path + abs(flow), elastic - flow
            out.append(soft * E * elastic)
        return out


def judge(bar: Bar, solution: Solution) -> dict[str, Figure]:
    """Return the figures: stress at every point, at the end of every stage."""
    figures = {}
    for k, sigma in enumerate(bar.stresses()):
        stress = solution.system.state("bar", solution.stages[str(k)]).stress
        off = np.abs(stress - np.array([sigma, 0.0, 0.0, 0.0])[:, None]).max()
        # without hardening the flow may gather anywhere: balance alone limits the difference
        figures[f"stress {k}"] = Figure(float(off) / YIELD, 1e-5)
    last = str(len(bar.strains) - 1)
    return figures | {"audit": Figure(float(len(solution.audit(last).violations)), 0.0)}


def draw(number: int, rng: np.random.Generator) -> Bar:
    """Return a bar: from hardly strained to far beyond yield, to and fro."""
    rule = RULES[number % 4]
    stages = int(rng.integers(2, 5))
    far = float(rng.choice([0.1, 1.0, 5.0, 20.0])) * YIELD / E
    hot = float(rng.choice([0.0, 50.0, 400.0]))
    ratio = float(rng.choice([1e-3, 0.02, 0.3]))
    drops = (float(rng.choice([0.0, 5e-4])), float(rng.choice([0.0, 1e-3])))
    return Bar(
        rule=rule,
        ratio=0.0 if rule == "none" else ratio,
        poisson_ratio=float(rng.choice([0.0, 0.3, 0.49])),
        element=ELEMENTS[number % 5],
        size=float(rng.choice([1e-3, 1.0, 1e3])),
        strains=tuple(far * rng.uniform(-1, 1, stages)),
        rises=tuple(hot * rng.uniform(0, 1, stages)),
        steps=int(rng.choice([1, 3, 10])),
        first=float(rng.choice([0.0, 150.0, -250.0])),
        drops=drops,
    )


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the bars."""
    rng = np.random.default_rng(SEED)
    bars = [draw(number, rng) for number in range(count)]
    return [Scene(what=brief(b), run=b.solve, judge=partial(judge, b)) for b in bars]
