"""Seeded bars in tension of laws beyond linear hardening, some of them beyond what they bear.

The strain of a bar under the stress s is ``s / E + p`` with the plastic strain p at which its curve
reaches s. Back stresses that fade follow their rates, which increments only tend to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from solver import Body, Model, PathControl, Solution, solve
from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Elasticity,
    Law,
    Layered,
    Table,
    TrescaMaterial,
    Voce,
)
from solver.mesh import grid
from tests.stability.closed import crooked, passed, stress_miss
from tests.stability.trial import Figure, Scene, tells

COUNT = 18
SEED = 1958
YIELD, LENGTH = 300.0, 4.0
KINDS = ("voce", "table", "chaboche", "layered", "tresca", "tresca, voce")
ELEMENTS = ("quad8", "quad4", "tri6", "quad9", "tri3")
CONTROL = PathControl(load_step=0.05, unload_steps=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A bar of some law under a tension of `load` times its yield stress."""

    kind: str
    law: Law
    load: float
    round: bool
    element: str
    perturb: float
    seed: int

    @property
    def has_corners(self) -> bool:
        """Whether the stress of the bar lies on an edge: softness then proves no limit."""
        return self.law.surface.has_corners

    def body(self, **how: Any) -> Body:
        """Return the bar, with a load and what else is given."""
        cells = 3, 4
        mesh = grid(
            np.linspace(0, 1, cells[0] + 1),
            np.linspace(0, LENGTH, cells[1] + 1),
            "tri" if self.element.startswith("tri") else "quad",
        )
        return Body(
            name="bar",
            mesh=crooked(mesh, self.perturb, cells, self.seed),
            material=self.law,
            kinematics="axisymmetric" if self.round else "plane_stress",
            element=self.element,
            supports={"left": "x", "bottom": "y"},
            **how,
        )

    def solve(self) -> Solution:
        """Pull the bar and let it go."""
        model = Model(bodies=(self.body(pressure={"top": -YIELD}),))
        return solve(model, load=self.load, control=CONTROL)

    def plastic_strain(self) -> float:
        """Return the plastic strain under load, from the curve of tension."""
        return self.plastic_strain_at(self.load * YIELD)

    def plastic_strain_at(self, stress: float) -> float:
        """Return the plastic strain at a stress [MPa], from the curve of tension."""
        if stress <= YIELD:
            return 0.0
        return float(brentq(lambda p: self.curve(p) - stress, 0.0, 10.0, xtol=1e-14))

    def curve(self, p: float) -> float:
        """Return the stress of the curve of tension at a plastic strain [MPa]."""
        law = self.law
        if isinstance(law, Layered):
            points = zip(law.yields, law.weights, strict=True)
            return _tension(law, p, list(points))
        assert isinstance(law, Chaboche | TrescaMaterial)
        own = float(law.curve.flow_stress(np.array([p]))[0])
        if isinstance(law, TrescaMaterial):
            return own
        rules = ((rule.modulus, rule.recall) for rule in law.back_stresses)
        parts = (c * (-math.expm1(-g * p) / g if g else p) for c, g in rules)
        return own + sum(parts)

    @property
    def limit(self) -> float:
        """The load that it tends to; inf where it hardens without end."""
        return self.law.ultimate_shear_stress / self.law.surface.shear(YIELD)


def _tension(law: Layered, p: float, layers: list[tuple[float, float]]) -> float:
    """Return the stress at plastic strain p of layers that are pulled together.

    With the strain e along and c across, a layer that flows has the stress of its yield along
    beside one of equal size in all directions; nothing is left across in the sum.
    """
    E, nu = law.elasticity.youngs_modulus, law.elasticity.poisson_ratio
    G, K = law.elasticity.shear_modulus, law.elasticity.bulk_modulus

    def along(d: float) -> float:  # d = e - c; 2 G d is the stress difference of an elastic layer
        flowing = sum(w * min(2 * G * d, y) for y, w in layers)
        return flowing + law.elastic_weight * 2 * G * d

    def plastic(d: float) -> float:
        stress = along(d)
        volume = stress / (3 * K)  # e + 2 c
        return (volume + 2 * d) / 3 - stress / E

    assert nu < 0.5
    return along(brentq(lambda d: plastic(d) - p, 0.0, 100.0, xtol=1e-15))


def random_bar(number: int, rng: np.random.Generator) -> Bar:
    """Return a bar; kinds and elements take turns, the rest is drawn."""
    kind = KINDS[number % len(KINDS)]
    elasticity = Elasticity(
        youngs_modulus=2e5, poisson_ratio=float(rng.choice([0.0, 0.3, 0.49, 0.4999]))
    )
    law = _law(kind, elasticity, rng)
    beyond = law.surface.shear(YIELD)
    limit = law.ultimate_shear_stress / beyond
    most = min(limit, 1.4)
    shares = (0.5, 0.95, 1.05) if math.isfinite(limit) else (0.5, 0.95)
    load = 1 + (most - 1) * float(rng.choice(shares)) if most > 1 else float(rng.choice([0.9, 1.1]))
    return Bar(
        kind=kind,
        law=law,
        load=load,
        round=bool(rng.random() < 0.5),
        element=ELEMENTS[number % len(ELEMENTS)],
        perturb=float(rng.choice([0.0, 0.15])),
        seed=int(rng.integers(1 << 30)),
    )


def _law(kind: str, elasticity: Elasticity, rng: np.random.Generator) -> Law:
    growth, rate = float(rng.uniform(20, 200)), float(10 ** rng.uniform(1, 3))
    voce = Voce(
        yield_stress=YIELD, saturation=growth, rate=rate, modulus=float(rng.choice([0.0, 1000.0]))
    )
    strain = np.append(0.0, np.cumsum(10 ** rng.uniform(-4, -2, 3)))
    steps = rng.uniform(0.05, 0.6) ** np.arange(1, 4)
    stress = YIELD + np.append(0.0, np.cumsum(np.diff(strain) * 2e4 * steps))
    if kind == "table":
        table = Table(plastic_strain=tuple(strain.tolist()), stress=tuple(stress.tolist()))
        return Chaboche(elasticity=elasticity, curve=table)
    if kind == "layered":
        total = strain + stress / elasticity.youngs_modulus
        last = (stress[-1] - stress[-2]) / (total[-1] - total[-2])
        slope = float(rng.choice([0.0, 0.5])) * last
        return Layered.of_curve(elasticity, total.tolist(), stress.tolist(), slope=slope)
    if kind.startswith("tresca"):
        curve = voce if kind == "tresca, voce" else Voce(yield_stress=YIELD)
        return TrescaMaterial(elasticity=elasticity, curve=curve)
    back = (ArmstrongFrederick(float(10 ** rng.uniform(3, 5)), rate), ArmstrongFrederick(500.0))
    return Chaboche(
        elasticity=elasticity, curve=voce, back_stresses=back if kind == "chaboche" else ()
    )


def judge(bar: Bar, solution: Solution) -> dict[str, Figure]:
    """Return the figures; steps of fading back stresses leave an error of first order."""
    stress = np.array([0.0, bar.load * YIELD, 0.0, 0.0])
    top = solution.system.full("bar").boundary_nodes("top")
    moved = solution.displacement("bar", "loaded")[1, top]
    wanted = LENGTH * (bar.load * YIELD / 2e5 + bar.plastic_strain())
    near = 0.2 if bar.kind == "chaboche" else 1e-4
    return {
        "audit": passed(solution),
        "uniform stress": Figure(stress_miss(solution, "bar", stress), 1e-6),
        "elongation": Figure(float(np.abs(moved - wanted).max()) / wanted, near),
        "residual stress": Figure(
            stress_miss(solution, "bar", 0 * stress, "unloaded", YIELD), 1e-6
        ),
    }


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the bars."""
    rng = np.random.default_rng(SEED)
    made = [random_bar(number, rng) for number in range(count)]
    return [
        Scene(
            what=f"{'round' if bar.round else 'flat'} bar of {bar.element}, {bar.kind}, pulled to "
            f"{bar.load:.4g} of its yield stress, which it bears up to {bar.limit:.4g}",
            run=bar.solve,
            judge=partial(judge, bar),
            certain=bar.limit * (1 + 1e-6),
            safe=bar.limit * (1 - 1e-6),
            load=bar.load,
            honest=tells("increment between") if bar.has_corners else None,
        )
        for bar in made
    ]
