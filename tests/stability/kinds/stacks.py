"""Seeded stacks of two or three bodies: any state, element, law, friction and sliding.

A body is at least as wide as the one on it, so a column of uniform stress under the pressure
on top, free of stress beside it, is in equilibrium and within yield: every load here has an
answer (limit analysis; friction can only help, D.C. Drucker 1954).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver import Body, ContactPair, Material, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.balance import judge
from tests.stability.closed import passed
from tests.stability.trial import Figure, Scene, brief, tells

COUNT = 28
SEED = 2024
STATES = ("plane_strain", "plane_stress", "axisymmetric")
ELEMENTS = ("quad8", "quad9", "quad4", "tri6", "tri3")
YIELD = 300.0


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A body of a stack."""

    material: Material
    element: str = "quad8"
    width: float = 4.0
    height: float = 3.0
    cells: tuple[int, int] = (4, 3)


@dataclass(frozen=True, kw_only=True)
class Stack:
    """Bodies on one another, the first on top; ``pads`` puts two copies of it side by side."""

    layers: tuple[Layer, ...]
    pressure: float
    state: str = "plane_strain"
    friction: float = 0.0
    sliding: str = "small"
    pads: bool = False
    slave_below: bool = False
    thickness: float = 1.0
    steps: int = 4

    def model(self) -> Model:
        """Return the stack, symmetric about x = 0, the lowest body on a frictionless floor."""
        bodies = []
        top = 0.0
        for k, layer in enumerate(self.layers):
            below = top - layer.height
            first = {"top": self.pressure} if k == 0 else {}
            bodies.append(self._body(f"body{k}", layer, below, 0.0, first, k))
            top = below
        if self.pads:
            extra = self._body("pad", self.layers[0], -self.layers[0].height, self._beside,
                               {"top": self.pressure}, 0)  # fmt: skip
            bodies.append(extra)
        return Model(bodies=tuple(bodies), contacts=self._pairs())

    @property
    def _beside(self) -> float:
        return self.layers[0].width * 1.3

    def _pairs(self) -> tuple[ContactPair, ...]:
        sides = [
            ((f"body{k}", "bottom"), (f"body{k + 1}", "top")) for k in range(len(self.layers) - 1)
        ]
        if self.pads:
            sides.append((("pad", "bottom"), ("body1", "top")))
        return tuple(
            ContactPair(
                slave=(lower if self.slave_below else upper),
                master=(upper if self.slave_below else lower),
                friction=self.friction,
                sliding=self.sliding,
            )
            for upper, lower in sides
        )

    def _body(
        self, name: str, layer: Layer, below: float, at: float, load: dict[str, float], k: int
    ) -> Body:
        last = k == len(self.layers) - 1
        nx, ny = layer.cells
        return Body(
            name=name,
            mesh=grid(
                at + np.linspace(0, layer.width, nx + 1),
                np.linspace(below, below + layer.height, ny + 1),
                "tri" if layer.element.startswith("tri") else "quad",
            ),
            material=layer.material,
            kinematics=self.state,
            element=layer.element,
            thickness=self.thickness,
            supports={"left": "x"} | ({"bottom": "y"} if last else {}),
            pressure=load,
        )

    @property
    def force(self) -> float:
        """On the first body [N]."""
        w = self.layers[0].width
        return self.pressure * (
            np.pi * w**2 if self.state == "axisymmetric" else w * self.thickness
        )

    def solve(self) -> Solution:
        """Return the solution."""
        control = PathControl(load_step=1.0 / self.steps, unload_steps=2)
        return solve(self.model(), control=control)

    def judge(self, solution: Solution) -> dict[str, Figure]:
        """Return the figures."""
        pairs = len(self._pairs())
        applied = dict.fromkeys(range(pairs), self.force)
        if self.pads:  # lower contacts carry both
            applied |= dict.fromkeys(range(1, pairs - 1), 2 * self.force)
        figures = judge(solution, applied)
        if self.stretched:  # surfaces turn too far in an increment for its balance of energy
            figures["audit"] = passed(solution, frozenset({"audit_energy"}))
        return figures

    @property
    def stretched(self) -> bool:
        """Whether a body under the pressure alone would strain plastically by more than one half.

        Surfaces that slide by finite distances then turn as much: hardening does not make sure
        of an equilibrium any more.
        """
        plastic = [k.material for k in self.layers if not k.material.elastic]
        return self.sliding == "finite" and any(
            self.pressure - m.yield_stress > 0.5 * m.plastic_modulus for m in plastic
        )

    def scene(self) -> Scene:
        """Return the scene."""
        honest = tells("increment between") if self.stretched else None
        return Scene(what=brief(self), run=self.solve, judge=self.judge, honest=honest)


def _material(rng: np.random.Generator) -> Material:
    law = str(rng.choice(["elastic", "none", "isotropic", "kinematic", "mixed"]))
    E, nu = 2e5 * 10 ** rng.uniform(-2, 1), float(rng.choice([0.0, 0.3, 0.45, 0.49]))
    if law == "elastic":
        return Material(youngs_modulus=E, poisson_ratio=nu)
    return Material(
        youngs_modulus=E,
        poisson_ratio=nu,
        yield_stress=YIELD,
        hardening=law,
        hardening_ratio=0.0 if law == "none" else float(10 ** rng.uniform(-4, -0.5)),
        isotropic_fraction=float(rng.random()),
    )


def random_stack(number: int, rng: np.random.Generator) -> Stack:
    """Return a stack; states and elements take turns, the rest is drawn."""
    state = STATES[number % 3]
    n = 2 + int(rng.random() < 0.5)
    widths = 4.0 * np.cumprod(np.append(1.0, rng.choice([1.0, 1.5, 2.2], n - 1)))
    matching = rng.random() < 0.4
    layers = []
    for k, width in enumerate(widths):
        per_width = 4 if matching else int(rng.integers(2, 6))
        layers.append(
            Layer(
                material=_material(rng),
                element=ELEMENTS[(number + 2 * k) % 5],
                width=float(width),
                height=float(rng.uniform(1.5, 5.0)),
                cells=(max(2, round(per_width * width / 4.0)), int(rng.integers(2, 4))),
            )
        )
    ideal = any(not m.elastic and m.plastic_modulus == 0 for m in (k.material for k in layers))
    ratio = rng.uniform(0.2, 0.9) if ideal else float(rng.choice([0.5, 0.98, 1.3, 2.0]))
    friction = float(rng.choice([0.0, 0.05, 0.3, 1.0]))
    return Stack(
        layers=tuple(layers),
        pressure=float(ratio * YIELD),
        state=state,
        friction=friction,
        sliding=str(rng.choice(["small", "small", "finite"])),
        thickness=float(10 ** rng.uniform(-2, 2)),
        steps=int(rng.choice([1, 4, 10])),
    )


def _with_pads(stack: Stack) -> Stack:
    """Return the stack with its first body twice, on others wide enough for both."""
    first, *others = stack.layers
    wide = [replace(o, width=12.0 + 2.0 * k, cells=(10, 3)) for k, o in enumerate(others)]
    return replace(stack, layers=(first, *wide), pads=True)


def _arranged(number: int, stack: Stack) -> Stack:
    """Return some of the stacks with two bodies side by side, some with the slave below."""
    if number % COUNT in (7, 10, 16, 25) and stack.state != "axisymmetric":
        return _with_pads(stack)
    if number % COUNT in (26, 27):
        return replace(stack, slave_below=True, sliding="small")
    return stack


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the stacks."""
    rng = np.random.default_rng(SEED)
    stacks = [random_stack(number, rng) for number in range(count)]
    return [_arranged(number, stack).scene() for number, stack in enumerate(stacks)]
