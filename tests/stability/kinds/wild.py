"""Seeded stacks of the worst kind: crooked thin elements that do not match, soft on stiff.

The stress of the column that carries the pressure (see `stacks`) makes sure of an answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver import Body, Material
from tests.stability.closed import crooked
from tests.stability.kinds.draws import RULES
from tests.stability.kinds.stacks import ELEMENTS, STATES, YIELD, Layer, Stack
from tests.stability.trial import Scene

COUNT = 6
SEED = 1952
FRICTION = (0.0, 0.1, 0.5, 1.0, 1.5)
POISSON = (0.0, 0.3, 0.45, 0.49, 0.4999)


@dataclass(frozen=True, kw_only=True)
class Crooked(Stack):
    """A stack whose nodes are moved within their bodies by a share of an element."""

    perturb: float = 0.0
    seed: int = 0

    def _body(
        self, name: str, layer: Layer, below: float, at: float, load: dict[str, float], k: int
    ) -> Body:
        body = super()._body(name, layer, below, at, load, k)
        return replace(body, mesh=crooked(body.mesh, self.perturb, layer.cells, self.seed + k))


def _material(rng: np.random.Generator, stiffness: float) -> Material:
    rule = str(rng.choice([*RULES, "elastic"]))
    elastic = Material(youngs_modulus=2e5 * stiffness, poisson_ratio=float(rng.choice(POISSON)))
    if rule == "elastic":
        return elastic
    return replace(
        elastic,
        yield_stress=YIELD * min(stiffness, 1.0),
        hardening=rule,
        hardening_ratio=0.0 if rule == "none" else float(10 ** rng.uniform(-6, -0.3)),
        isotropic_fraction=float(rng.random()),
    )


def random_stack(number: int, rng: np.random.Generator) -> Crooked:
    """Return a stack of two bodies; states and elements take turns, the rest is drawn."""
    stiffness = float(10 ** rng.choice([0.0, *rng.uniform(-5, 5, 3)]))
    materials = _material(rng, stiffness), _material(rng, 1.0)
    wide = float(rng.choice([1.0, 1.5, 3.0]))
    coarse, fine = int(rng.integers(1, 4)), int(rng.choice([3, 8, 20]))
    columns = [coarse, coarse * fine] if rng.random() < 0.5 else [coarse * fine, coarse]
    thin = float(10 ** rng.choice([0.0, *rng.uniform(-1.7, 0, 2)]))
    layers = tuple(
        Layer(
            material=material,
            element=ELEMENTS[(number + 2 * k) % 5],
            width=4.0 * wide**k,
            height=3.0 * (thin if k == 0 else 1.0),
            cells=(max(columns[k], 1), int(rng.integers(1, 4))),
        )
        for k, material in enumerate(materials)
    )
    weakest = min(min(m.yield_stress, 1e-3 * m.youngs_modulus) for m in materials)
    ideal = any(not m.elastic and m.plastic_modulus < 1e-3 * m.youngs_modulus for m in materials)
    ratio = float(rng.choice([0.01, 0.5, 0.95] if ideal else [0.5, 0.98, 1.3, 2.0]))
    return Crooked(
        layers=layers,
        pressure=ratio * weakest,
        state=STATES[number % 3],
        friction=float(rng.choice(FRICTION)),
        sliding=str(rng.choice(["small", "small", "finite"])),
        slave_below=bool(rng.random() < 0.3) and wide == 1.0,
        thickness=float(10 ** rng.uniform(-2, 2)),
        steps=int(rng.choice([1, 4, 10])),
        perturb=float(rng.choice([0.0, 0.1, 0.25])),
        seed=number,
    )


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the stacks."""
    rng = np.random.default_rng(SEED)
    return [random_stack(number, rng).scene() for number in range(count)]
