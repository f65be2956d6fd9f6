"""Rigid plates and balls on blocks, moved or pushed: small and large, hard and soft."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import (
    Body,
    ContactPair,
    Material,
    Model,
    Moved,
    PathControl,
    Pushed,
    RigidBody,
    Solution,
    solve,
)
from solver.mesh import graded, grid
from solver.model.rigid import arc, line
from tests.stability.closed import passed
from tests.stability.trial import Figure, Scene, brief

COUNT = 6
SEED = 1781
E, YIELD = 2e5, 400.0
ELEMENTS = ("quad8", "quad4", "quad9")
MUCH = 1e-3
"""Mean pressure / Young's modulus from which a block under a ball yields."""


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """A block under a rigid body [N, mm, MPa].

    Attributes
    ----------
    force : mean pressure that pushes it / Young's modulus
    off : how far from the middle a plate is pushed / width of the block
    """

    kind: str
    size: float
    modulus: float
    poisson_ratio: float
    force: float
    off: float
    friction: float
    element: str
    rigid_slave: bool
    hardening_ratio: float

    @property
    def material(self) -> Material:
        """Of the block; it is elastic under a plate and under a little load."""
        return Material(
            youngs_modulus=self.modulus, poisson_ratio=self.poisson_ratio,
            yield_stress=YIELD / E * self.modulus if self.yields else np.inf,
            hardening="isotropic" if self.hardening_ratio else "none",
            hardening_ratio=self.hardening_ratio,
        )  # fmt: skip

    @property
    def yields(self) -> bool:
        """Whether the block does."""
        return self.kind == "ball" and self.force > MUCH

    @property
    def push(self) -> float:
        """The force on the rigid body, downward [N]."""
        area = np.pi * self.size**2 if self.kind == "ball" else self.size
        return self.force * self.modulus * area

    def model(self, moved: float | None = None) -> Model:
        """Return the model: pushed by the force, or moved down."""
        a = self.size
        way = {"y": Pushed(value=-self.push) if moved is None else Moved(value=moved)}
        if self.kind == "ball":
            x = graded(6 * a, a / 8, 1.4, 2 * a)
            # slaves finer than their masters could not be followed by them
            pieces = 12 if self.rigid_slave else 60
            cap = arc((0.0, 10 * a), 10 * a, (-np.pi / 2, -np.pi / 2 + 0.25), pieces)
            rigid = RigidBody(name="tool", surfaces={"base": cap}, **way)
            kinematics = "axisymmetric"
        else:
            x = a * np.linspace(0, 1, 7)
            # as a slave it needs points of its own: one edge bears no moment
            base = line((-0.5 * a, 0.0), (1.5 * a, 0.0), 24 if self.rigid_slave else 1)
            turning = {} if moved is not None else {
                "rotation": Pushed(value=-self.push * self.off * a)
            }  # fmt: skip
            rigid = RigidBody(
                name="tool", surfaces={"base": base}, centre=(a / 2, 0.0), **way, **turning
            )
            kinematics = "plane_stress"
        held = {"left": "x", "bottom": "xy"} if self.kind == "ball" else {"bottom": "y"}
        corner = {} if self.kind == "ball" else {"left": "x"}
        block = Body(name="block", mesh=grid(x, -x[::-1]), material=self.material,
                     kinematics=kinematics, element=self.element,
                     supports=held | corner)  # fmt: skip
        sides = [("block", "top"), ("tool", "base")]
        slave, master = sides[::-1] if self.rigid_slave else sides
        pair = ContactPair(slave=slave, master=master, friction=self.friction)
        return Model(bodies=(block,), rigid=(rigid,), contacts=(pair,))

    def solve(self) -> tuple[Solution, Solution | None]:
        """Return the solution under the force and, of an elastic ball, that of the same motion."""
        control = PathControl(load_step=0.25, unload_steps=2)
        pushed = solve(self.model(), control=control)
        if self.kind != "ball" or self.yields or self.friction:
            return pushed, None
        return pushed, solve(self.model(pushed.motion("tool", "loaded").y), control=control)


BALL = frozenset({"audit_touch_time"})
"""What the audit says of a force so small that one vertex of a ball touches, with right forces."""


def judge(pressed: Pressed, found: tuple[Solution, Solution | None]) -> dict[str, Figure]:
    """Return the figures: what pushes is what presses, and where."""
    pushed, moved = found
    push, a = pressed.push, pressed.size
    _, y, moment = pushed.reaction("tool", "loaded")
    contact = pushed.loaded.state.contacts[0]
    N = contact.normal
    leaning = 0.05 if pressed.kind == "ball" else 1e-6  # of the normals of a ball
    figures = {
        "audit": passed(pushed, BALL if pressed.kind == "ball" else frozenset()),
        "force": Figure(abs(y + push) / push, 1e-6),
        "contact": Figure(abs(float(N.sum()) - push) / push, leaning),
        "tension": Figure(-float(N.min()) / push, 0.0),
        "cone": Figure(float((np.abs(contact.tangential) - pressed.friction * N).max()) / push,
                       1e-6),
    }  # fmt: skip
    if moved is not None:
        back = moved.reaction("tool", "loaded")[1]
        figures["moved"] = Figure(abs(back + push) / push, 1e-5)
    if pressed.kind == "plate":
        whole = pushed.system.full("block")
        nodes = whole.boundary_nodes("top")
        force = whole.undeformed.internal_force(pushed.system.state("block", pushed.loaded).stress)
        at = -float(force[2 * nodes + 1] @ (whole.X[0, nodes] - a / 2)) / push
        figures["moment"] = Figure(abs(at - pressed.off * a) / a, 1e-5)
        figures["turning"] = Figure(abs(moment + push * pressed.off * a) / (push * a), 1e-6)
    return figures


def draw(number: int, rng: np.random.Generator) -> Pressed:
    """Return a plate or a ball."""
    kind = ("plate", "ball")[number % 2]
    return Pressed(
        kind=kind,
        size=float(10 ** rng.uniform(-4, 4)),
        modulus=float(10 ** rng.uniform(0, 6)),
        poisson_ratio=float(rng.choice([0.0, 0.3, 0.49])),
        force=float(rng.choice([1e-9, 1e-6, 1e-4, 2e-3])),
        off=float(rng.choice([0.0, 0.1, -0.15])) if kind == "plate" else 0.0,
        friction=float(rng.choice([0.0, 0.0, 0.3, 5.0])) if kind == "ball" else 0.0,
        element=ELEMENTS[number % 3],
        rigid_slave=bool(rng.integers(2)),
        hardening_ratio=float(rng.choice([0.0, 0.02])),
    )


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the plates and balls."""
    rng = np.random.default_rng(SEED)
    each = [draw(number, rng) for number in range(count)]
    return [Scene(what=brief(p), run=p.solve, judge=partial(judge, p)) for p in each]
